"""What is said of a damping that may be a delay."""

from __future__ import annotations

import pytest

from identify.bounds.damping_or_lag import lag_for_damping
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.platform import Platform
from tests.identify.simulated import TRUTH, sine_run

WEAK = 0.01 * TRUTH[0]


def runs(*sets: tuple[float, float], soft_s: float = 0.0) -> list[Trace]:
    return [prepare(sine_run(m, f, soft_s=soft_s, seed=i), i) for i, (m, f) in enumerate(sets)]


def test_slow_sets_are_said_to_leave_damping_and_delay_open() -> None:
    said = lag_for_damping(Platform(*TRUTH), WEAK, runs((85.0, 0.5), (85.0, 1.0), soft_s=1.0), "rotary")
    assert "undeclared 1 ms adds 0.68 N m s/rad to the identified C of 0.0450 N m s/rad" in said
    assert "29 Hz" in said


@pytest.mark.parametrize(
    "platform",
    [Platform(*TRUTH, {"sensor_lag": {"time": 1e-3}}), Platform(*TRUTH, terms=("inertia", "stiffness"))],
)
def test_nothing_is_said_where_a_lag_is_known_or_no_damping_asked_for(platform: Platform) -> None:
    assert lag_for_damping(platform, WEAK, runs((85.0, 0.5), (85.0, 1.0), soft_s=1.0), "rotary") == ""


def test_nothing_is_said_of_a_campaign_with_a_set_near_the_resonance() -> None:
    assert lag_for_damping(Platform(*TRUTH), WEAK, runs((85.0, 0.5), (5.0, 25.0)), "rotary") == ""


def test_nothing_is_said_of_sets_that_ring() -> None:
    assert lag_for_damping(Platform(*TRUTH), WEAK, runs((111.0, 1.0), (104.0, 3.0)), "rotary") == ""


def test_nothing_is_said_where_the_inertia_is_known_well() -> None:
    slow = runs((85.0, 0.5), (85.0, 1.0), soft_s=1.0)
    assert lag_for_damping(Platform(*TRUTH), 1e-5 * TRUTH[0], slow, "rotary") == ""
