"""Torques are printed with four digits, and never as more than they are."""

from __future__ import annotations

import math

import pytest

from rig.rounding import rounded_down


@pytest.mark.parametrize(
    ("value", "said"),
    [(106.95, "106.9"), (99.309, "99.30"), (0.0, "0"), (0.012349, "0.01234"), (12345.6, "12345"), (math.inf, "inf")],
)
def test_a_torque_is_rounded_down(value: float, said: str) -> None:
    assert rounded_down(value) == said
