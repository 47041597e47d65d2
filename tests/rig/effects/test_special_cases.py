"""An effect that contains a simpler one does what that does where it says so."""

from __future__ import annotations

import numpy as np
import pytest

from rig import effects
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform

TIME = np.arange(2001) * 1e-3
TORQUE = TorqueSignal(TIME, 8.0 * np.sin(2.0 * np.pi * 3.0 * TIME))
SIMPLE = {"coulomb_friction": {"level": 1.3}, "presliding_friction": {"level": 1.3, "displacement": 0.004}}
BESIDE = {"speed": 0.4}  # what makes no difference there
PAIRS = [
    (name, special) for name in effects.known() for special in (effects.get(name).from_special or {})
]  # fmt: skip


@pytest.mark.parametrize(("name", "special"), PAIRS)
def test_a_richer_effect_moves_the_platform_as_its_special_case_does(name: str, special: str) -> None:
    same = (effects.get(name).from_special or {})[special]
    own = same(tuple(SIMPLE[special][p.name] for p in effects.get(special).parameters))
    keys = [p.name for p in effects.get(name).parameters]
    assert set(own) <= set(keys)
    assert special in effects.get(name).nests
    rich = Platform(0.02, 0.05, 200.0, {name: {k: own.get(k, BESIDE.get(k, np.nan)) for k in keys}})
    rates = [
        simulate(platform, TIME, TORQUE, substeps=32).sensed_rate_rad_s
        for platform in (rich, Platform(0.02, 0.05, 200.0, {special: SIMPLE[special]}))
    ]
    assert np.max(np.abs(rates[0])) > 0.5
    assert rates[0] == pytest.approx(rates[1], abs=1e-6)


def test_there_are_such_pairs() -> None:
    assert ("hysteresis", "presliding_friction") in PAIRS
    assert ("stribeck_friction", "coulomb_friction") in PAIRS
