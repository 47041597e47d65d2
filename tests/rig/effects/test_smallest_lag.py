"""A lag or a delay that tends to zero does in proportion less: a fit that came to zero finds out again."""

from __future__ import annotations

import numpy as np
import pytest

from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform

TIME = 1e-3 * np.arange(2000)
TORQUE = TorqueSignal(TIME, 50.0 * np.sin(2.0 * np.pi * 4.0 * TIME))


def read(effects: dict[str, dict[str, float]]) -> Array:
    return simulate(Platform(0.02, 0.5, 600.0, effects), TIME, TORQUE, (0.0, 0.0), substeps=4).sensed_rate_rad_s[500:]


@pytest.mark.parametrize(
    ("name", "parameter"),
    [("sensor_lag", "time"), ("sensor_lag_second_order", "time"), ("actuator_lag", "time"), ("torque_delay", "delay")],
)
@pytest.mark.parametrize("small_s", [1e-10, 1e-8])
def test_what_a_lag_does_is_in_proportion_to_it_down_to_zero(name: str, parameter: str, small_s: float) -> None:
    without = read({})
    little, more = (read({name: {parameter: s}}) - without for s in (small_s, 1e-6))
    assert little / small_s == pytest.approx(more / 1e-6, abs=0.02 * np.max(np.abs(more)) / 1e-6)
