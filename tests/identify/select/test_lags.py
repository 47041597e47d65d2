"""Lags: one weight for what is the same in torque, and none for what only a negative damping makes possible."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identify.model.structure import Structure
from identify.select.lags import PASSIVE_SIGMAS, SAME_DELAY, KnownDelays, takes_damping


def fit(
    effect: str | None, parameter: str = "", value: float = 0.0, damping: float | None = 0.1, beside: str = ""
) -> Any:
    values: dict[Any, float] = {("inertia",): 1.0} | ({("damping",): damping} if damping is not None else {})
    values |= {(effect, parameter): value} if effect else {}
    structure = Structure(effects=tuple(e for e in (beside, effect) if e))
    return SimpleNamespace(structure=structure, values=values, names=tuple(values), std_error=lambda name: 0.1)


def test_only_a_delay_as_long_beside_the_same_effects_lends_its_weight() -> None:
    known = KnownDelays()
    known.add("torque_delay", fit("torque_delay", "delay", 2e-3), 0.7)
    for late_s, expected in ((2e-3, 0.7), (2e-3 * (1.0 + 0.9 * SAME_DELAY), 0.7), (2.5e-3, 0.0)):
        assert known.weight_of("sensor_lag", fit("sensor_lag", "time", late_s)) == expected
    other = fit("sensor_lag", "time", 2e-3, beside="coulomb_friction")
    other.values["coulomb_friction", "level"] = 1.0
    assert known.weight_of("sensor_lag", other) == 0.0


@pytest.mark.parametrize(
    ("effect", "parameter", "before", "after", "taken"),
    [
        ("torque_delay", "delay", 0.1, -0.1 * (PASSIVE_SIGMAS + 1.0), True),
        ("actuator_lag", "time", 0.1, -1.0, True),
        ("sensor_lag", "time", 0.1, -1.0, True),
        ("torque_delay", "delay", 0.1, -0.1 * (PASSIVE_SIGMAS - 1.0), False),  # zero as well
        ("torque_delay", "delay", -1.0, -1.0, False),  # it was there before
        ("torque_delay", "delay", None, None, False),
        ("coulomb_friction", "level", 0.1, -1.0, False),  # no lag
    ],
)
def test_a_lag_that_takes_the_damping_below_zero(
    effect: str, parameter: str, before: float | None, after: float | None, taken: bool
) -> None:
    assert takes_damping(effect, fit(None, damping=before), fit(effect, parameter, 1e-3, after)) is taken
