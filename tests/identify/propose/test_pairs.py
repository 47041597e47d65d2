"""Two effects that show only together."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimate.initial_guess import first_guess, scale_of
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores, _Projected
from identify.signals.prepare import one_noise, prepare
from rig.platform import TERMS
from tests.identify.simulated import sine_run

NAMES = ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "torque_delay")


def test_two_directions_that_nearly_agree_explain_together_what_neither_does_alone() -> None:
    rng = np.random.default_rng(1)
    shared, apart = np.linalg.qr(rng.standard_normal((400, 2)))[0].T
    one = _Projected((shared + 0.1 * apart)[:, None], [({}, True)], np.zeros((0, 1)))
    other = _Projected((shared - 0.1 * apart)[:, None], [({}, True)], np.zeros((0, 1)))
    left = 5.0 * apart
    alone = [part.solved(left)[1] for part in (one, other)]
    shares, fall = one.beside(other).solved(left)
    assert max(alone) < 0.02 * 25.0
    assert fall == pytest.approx(25.0, rel=1e-6)
    np.testing.assert_allclose(shares, [25.0, -25.0], rtol=1e-6)


def test_a_direction_that_may_not_turn_its_sign_stays_out_of_a_pair() -> None:
    shared, apart = np.eye(3)[:2]
    one = _Projected((shared + 0.1 * apart)[:, None], [({}, False)], np.zeros((0, 1)))
    other = _Projected((shared - 0.1 * apart)[:, None], [({}, False)], np.zeros((0, 1)))
    shares, fall = one.beside(other).solved(5.0 * apart)
    assert shares[1] == 0.0
    assert fall == pytest.approx(one.solved(5.0 * apart)[1])


def test_effects_that_show_alone_are_no_pair() -> None:
    run = sine_run(104.0, 3.0, seed=5, effects={"coulomb_friction": {"level": 2.0}})
    traces = one_noise([prepare(run, 0)], False)
    problem = PredictionError(traces)
    guess = first_guess(traces, Structure()).platform
    fit = problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, guess, strict=True)})  # type: ignore[arg-type]
    tests = InnovationScores(problem, fit, scale_of(traces, guess, ()))
    singles = [v[0] for v in tests.all(NAMES)]
    assert all("coulomb_friction" not in (a.effect, b.effect) for a, b, _ in tests.pairs(singles))
