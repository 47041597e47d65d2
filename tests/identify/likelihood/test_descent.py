"""A fit goes on where a valley leads down, and keeps a run's own bias within reason."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.likelihood.descent import Descent
from identify.likelihood.fit import Fit
from identify.likelihood.normal_equations import changed
from identify.likelihood.other_noise import noise_alone
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import MOST_BIAS_RAD_S, Trace
from rig.dynamics.gains import Noise
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, Effects, sine_run

HEAVY = (0.0592, 0.353, 1158.0)
UNBALANCE = {"sine": -3.6, "cosine": 23.2}
SETS = ((150.0, 1.0), (130.0, 5.0), (60.0, 15.0))


def traces(
    effects: Effects | None = None, jck: tuple[float, float, float] = TRUTH, lasts_s: float = 1.5
) -> list[Trace]:
    runs = [
        sine_run(m, f, seed=i, effects=effects, jck=jck, noise=1.7e-4, duration_s=lasts_s)
        for i, (m, f) in enumerate(SETS)
    ]
    return one_noise([prepare(run, i) for i, run in enumerate(runs)], False)


def test_a_fit_arrives_along_the_valley_of_an_unbalance_beside_a_stiffness() -> None:
    problem = PredictionError(traces({"unbalance": UNBALANCE}, HEAVY))
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, HEAVY, strict=True)}
    base = problem.fit(Structure(), platform)
    structure = Structure().plus("unbalance")
    along: dict[Name, float] = {**base.values, ("unbalance", "sine"): 16.0, ("unbalance", "cosine"): 22.0}
    along["stiffness",] -= 16.0  # what the unbalance has at small angles
    found = problem.fit(structure, along, base.noise, 14, carry=base.shots, thorough=False, against=base.cost)
    right = {**platform, **{("unbalance", k): v for k, v in UNBALANCE.items()}}
    best = problem.fit(structure, right)
    assert base.cost - best.cost > 1000.0
    assert found.cost < best.cost + 0.02 * (base.cost - best.cost)


def test_no_step_takes_a_gyros_bias_beyond_what_a_gyro_has() -> None:
    problem = PredictionError(traces())
    fit = problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)})
    shots = fit.shots[0]
    assert abs(float(np.mean(shots.trace.measured))) < 0.5 * MOST_BIAS_RAD_S
    assert changed(shots, np.array([10.0])).bias == pytest.approx(MOST_BIAS_RAD_S)
    assert changed(shots, np.array([-10.0])).bias == pytest.approx(-MOST_BIAS_RAD_S)
    assert changed(shots, np.array([1e-3])).bias == pytest.approx(shots.bias + 1e-3)


def test_the_noise_ahead_of_a_gyros_low_pass_is_paid_for() -> None:
    problem = PredictionError(traces())
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    late = {**platform, ("sensor_lag", "time"): 1e-3}
    models = ((Structure(), platform), (Structure().plus("sensor_lag"), late))
    fits = [problem.fit(structure, start, iterations=0, thorough=False) for structure, start in models]
    numbers = [(f.penalised - f.cost) / np.log(f.count) for f in fits]
    assert numbers == pytest.approx([3.0, 5.0])


@cache
def beside_friction() -> tuple[PredictionError, Fit]:
    """The model without the friction, whose noise is to be found."""
    problem = PredictionError(traces({"coulomb_friction": {"level": 1.2}}, lasts_s=3.0))
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    return problem, problem.fit(Structure(), platform)


@pytest.mark.parametrize("white, smooth, time", [(1e-4, 1e3, 1.0), (1e3, 1e-4, 10.0), (1e-3, 1e-3, 0.03)])
def test_the_likeliest_noise_is_found_from_decades_off(white: float, smooth: float, time: float) -> None:
    problem, known = beside_friction()

    def descent(noise: Noise) -> Descent:
        return Descent(problem, Structure(), known.values, problem.bounds.within(noise), known.shots, ())

    best, far = descent(known.noise), known.noise
    far = replace(far, white=white * far.white, smooth=smooth * far.smooth, time_constant_s=time * far.time_constant_s)
    moved = descent(far)
    begun = moved.cost
    noise_alone(best)
    noise_alone(moved)
    assert begun > best.cost + 100.0
    assert moved.cost < best.cost + 0.01 * (begun - best.cost)
