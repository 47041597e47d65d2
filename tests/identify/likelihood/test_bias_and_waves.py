"""A gyro's bias turns the angle far in a long run: beside a wave over the angle the two have to be fitted together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.likelihood.derivatives import derivatives
from identify.likelihood.descent import Descent
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.simulate.shots import with_bias
from rig.dynamics.gains import Noise
from tests.identify.simulated import NOISE_RAD_S, sine_run

FREE = (0.0148, 0.09, 0.0)  # an axis without a spring
COGGING = {"sine": 0.06, "cosine": 0.28, "order": 4.0}
STRUCTURE = Structure(("inertia", "damping"), ("cogging",))
TRUE: dict[Name, float] = {("inertia",): FREE[0], ("damping",): FREE[1]} | {
    ("cogging", key): value for key, value in COGGING.items()
}


def problem_of(seed: int) -> PredictionError:
    run = sine_run(
        0.9, 0.7, jck=FREE, effects={"cogging": COGGING}, duration_s=12.0, noise=4.0 * NOISE_RAD_S, bias=2e-3, seed=seed
    )
    some = slice(None, None, 5)
    assert run.rate_rad_s is not None
    run = replace(run, time_s=run.time_s[some], valid=run.valid[some], rate_rad_s=run.rate_rad_s[some])
    return PredictionError(one_noise([prepare(run)], False))


def test_what_a_bias_does_is_told_to_a_thousandth() -> None:
    problem = problem_of(0)
    descent = Descent(problem, STRUCTURE, TRUE, Noise(smooth=1.0, time_constant_s=0.05), None, ())
    own = derivatives(descent._operating_point(), {}, [])[0].columns.own[:, 0]
    shots, base = descent.shots[0], descent.looks[0]

    def away(bias: float) -> np.ndarray:
        there = problem.look(
            with_bias(shots, shots.bias + bias), STRUCTURE, descent.names, descent.x, descent.noise, base.gains
        )
        return np.asarray((there.innovations / np.sqrt(base.variance))[shots.weight].ravel())

    both_sides = (away(-1e-7) - away(1e-7)) / 2e-7
    assert float(np.linalg.norm(own - both_sides)) < 1e-3 * float(np.linalg.norm(own))


@pytest.mark.parametrize("seed", range(4))
def test_a_fit_begun_at_the_truth_arrives_where_only_noise_is_left(seed: int) -> None:
    fit = problem_of(seed).fit(STRUCTURE, TRUE)
    assert fit.reduced_chi_square < 1.1
    assert fit.values[("cogging", "order")] == pytest.approx(4.0, abs=1e-3)
    for key in ("sine", "cosine"):  # the angle counts from where the run begins
        assert fit.values[("cogging", key)] == pytest.approx(COGGING[key], abs=1e-3)
    assert fit.values[("inertia",)] == pytest.approx(FREE[0], rel=2e-3)
