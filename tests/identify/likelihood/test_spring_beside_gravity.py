"""A stiffness beside an effect that may push is a spring: one that softens is no gravity beside a pushing one."""

from __future__ import annotations

import math

import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name, bounds_of, names_of
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from rig import effects
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run

SETS = ((67.0, 1.0), (67.0, 6.0), (42.0, 9.0))
SOFTER = -2000.0  # N m/rad^3: a tenth of the spring's torque at 10 deg


@pytest.mark.parametrize("effect", ["unbalance", "cogging"])
def test_beside_an_effect_that_may_push_the_stiffness_pulls(effect: str) -> None:
    names = names_of(Structure().plus(effect), 1)
    assert bounds_of(("stiffness",), names) == (0.0, math.inf)
    assert bounds_of(("damping",), names) == (-math.inf, math.inf)


def test_gravity_that_nothing_stands_for_may_push_against_the_declared_stiffness() -> None:
    for effect in ("cubic_stiffness", "coulomb_friction", "torque_offset"):
        assert not effects.get(effect).may_push
        assert bounds_of(("stiffness",), names_of(Structure().plus(effect), 1)) == (-math.inf, math.inf)


def test_a_spring_that_softens_is_likelier_than_gravity_beside_a_spring() -> None:
    runs = [
        sine_run(m, f, seed=i, effects={"cubic_stiffness": {"factor": SOFTER}}, duration_s=1.5)
        for i, (m, f) in enumerate(SETS)
    ]
    problem = PredictionError(one_noise([prepare(run, i) for i, run in enumerate(runs)], False))
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    base = problem.fit(Structure(), platform)
    cubic = problem.fit(Structure().plus("cubic_stiffness"), base.values, base.noise, carry=base.shots)
    # Sine and cubic agree to the fifth power of the angle, so gravity of 18 times the spring would fit beside K < 0.
    start: dict[Name, float] = {**base.values, ("unbalance", "sine"): -6.0 * SOFTER}
    start["stiffness",] = TRUTH[2] + 6.0 * SOFTER
    gravity = problem.fit(Structure().plus("unbalance"), start, base.noise, carry=base.shots)
    assert gravity.values["stiffness",] >= 0.0
    assert cubic.values["stiffness",] == pytest.approx(TRUTH[2], rel=1e-3)
    assert cubic.cost < gravity.cost - 100.0
