"""Which group of channels gives the times of a table."""

from __future__ import annotations

import numpy as np
import pytest

from rig.recording.rasters import Group, base_of

FAST, SLOW = np.arange(1000) * 1e-3, np.arange(100) * 1e-2


@pytest.mark.parametrize(
    ("unit", "is_joined"), [("°C", True), ("g", True), ("Nm", False), ("V", False), ("A", False), ("", False)]
)
def test_a_slow_group_is_joined_where_its_unit_is_of_neither_torque_nor_motion(unit: str, is_joined: bool) -> None:
    fast = Group("fast", FAST, {"a": FAST}, {"a": "deg/s"})
    slow = Group("slow", SLOW, {"b": SLOW}, {"b": unit})
    assert base_of([fast, slow]) is (fast if is_joined else slow)


def test_where_no_unit_is_of_motion_the_slowest_measurement_gives_the_times() -> None:
    groups = [Group("fast", FAST, {"a": FAST}, {"a": "°C"}), Group("slow", SLOW, {"b": SLOW}, {"b": "K"})]
    assert base_of(groups) is groups[1]
    assert base_of([Group("untimed", None, {"a": FAST})]) is None
