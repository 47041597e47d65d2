"""A trip on travel or rate names what may have caused it, where the declared model stayed clear of it."""

from __future__ import annotations

import math

import pytest

from rig.clock import VirtualClock
from rig.config.limits import LimitsConfig
from rig.errors import DeviceFault, SafetyTrip
from rig.excitation import Sine, planned
from rig.guard import Guard, Trip
from rig.interface import Exchange, GyroSample
from rig.platform import Platform
from rig.sequencer import Sequencer
from rig.sequencer.declared_motion import explained, suspected_cause
from rig.sequencer.held_torque import HeldTorque, Pulse
from tests.rig.scripted import ScriptedRig

SLOW = planned((Sine(torque_nm=20, frequency_hz=0.5, duration_s=2.0),))
FAST = planned((Sine(torque_nm=20, frequency_hz=60, duration_s=0.5),))
SPRING = Platform(0.02, 0.045, 677.3)  # rings at 29 Hz
FREE = Platform(0.5, 0.1, 0.0, terms=("inertia", "damping"))


def travel(allowed_deg: float) -> Trip:
    return Trip("travel (limits.travel_deg; 0.1 deg of it is possible drift of the gyro)", allowed_deg, allowed_deg,
                "deg", 0.2, "Lower torque_nm.")  # fmt: skip


def rate(allowed_deg_s: float) -> Trip:
    return Trip("rate (limits.rate_deg_s)", allowed_deg_s, allowed_deg_s, "deg/s", 0.2, "Lower torque_nm.")


def test_below_the_resonance_it_is_the_stiffness() -> None:
    said = suspected_cause(travel(10.0), [], SPRING, SLOW, 5.0)
    assert said.startswith("The declared model predicted at most 1.71 ")
    assert "the declared stiffness may be too large." in said


def test_above_the_resonance_and_without_a_spring_it_is_the_inertia() -> None:
    assert "the declared inertia may be too large" in suspected_cause(rate(1e4), [], SPRING, FAST, 5.0)
    assert suspected_cause(rate(3e3), [], FREE, SLOW, 5.0).endswith("the declared inertia may be too large.")


def test_a_set_just_below_the_resonance_may_ring_because_the_inertia_is_too_small() -> None:
    below = planned((Sine(torque_nm=20, frequency_hz=15, duration_s=1.0),))
    assert "the declared inertia may be too small" in suspected_cause(travel(90.0), [], SPRING, below, 5.0)


def test_without_a_spring_the_sets_before_count() -> None:
    twice = suspected_cause(travel(1e5), [], FREE, SLOW * 2, 0.5)
    once = suspected_cause(travel(1e5), [], FREE, SLOW, 0.5)
    assert twice != once


def test_a_prediction_near_the_limit_and_other_limits_say_nothing_of_the_model() -> None:
    assert suspected_cause(travel(2.0), [], SPRING, SLOW, 5.0) == ""
    stale = Trip("gyro stale (limits.stale_gyro_ms)", 30.0, 20.0, "ms", 0.2, "Check the cable.")
    assert suspected_cause(stale, [], SPRING, SLOW, 5.0) == ""


def test_a_model_that_runs_away_predicts_nothing() -> None:
    assert suspected_cause(travel(90.0), [], Platform(0.02, -5.0, 677.3), SLOW, 5.0) == ""


def test_only_a_trip_during_a_set_is_explained() -> None:
    fault = DeviceFault("gyro unplugged")
    assert explained(fault, travel(10.0), [], SPRING, SLOW, 5.0) is fault
    trip = SafetyTrip("Torque is off.")
    assert explained(trip, travel(10.0), [], SPRING, (), 5.0) is trip
    assert explained(trip, travel(10.0), [], None, SLOW, 5.0) is trip
    assert str(explained(trip, travel(10.0), [], SPRING, SLOW, 5.0)).startswith("Torque is off. The declared model")


@pytest.mark.parametrize("declared", [SPRING, None])
def test_the_sequencer_adds_it_once_everything_is_closed(declared: Platform | None) -> None:
    def fast(now_s: float) -> Exchange | None:
        return Exchange((GyroSample(now_s, math.radians(500), True),), ()) if now_s > 0.6995 else None

    rig = ScriptedRig(fast)
    sequencer = Sequencer(
        rig, VirtualClock(), Guard(LimitsConfig()), sample_rate_hz=1000, rest_s=0.2, declared=declared
    )  # fmt: skip
    campaign = sequencer.play(SLOW)
    assert isinstance(campaign.cause, SafetyTrip)
    assert ("The declared model predicted at most" in str(campaign.cause)) == (declared is not None)
    assert "rate (limits.rate_deg_s): 500 deg/s at 0.199 s" in str(campaign.cause)
    assert rig.log[2] == "torque off" and rig.log[-2:] == ["disarm", "close"]
    assert campaign.recording.info["aborted"] == str(campaign.cause)


def test_a_late_tick_strikes_the_platform_as_the_pulse_says() -> None:
    """Held for 12 ms in the middle of a slope: the rate left afterwards, against that without, is impulse / J."""
    j, c, k = SPRING.inertia_kg_m2, SPRING.damping_nm_s_rad, SPRING.stiffness_nm_rad
    slope_nm_s, late_s, step_s = 2000.0, 12e-3, 1e-6
    held = HeldTorque()
    held.take(0.0, 0.0, 1e-3, 0.0)
    held.take(1e-3 + late_s, late_s, 1e-3, slope_nm_s * late_s)
    (pulse,) = held.pulses(1e-3 + late_s)
    swing = [0.0, 0.0]  # angle and rate of the difference: its torque is what was not played
    for step in range(round(late_s / step_s)):
        torque_nm = -slope_nm_s * step * step_s
        swing[1] += step_s * (torque_nm - c * swing[1] - k * swing[0]) / j
        swing[0] += step_s * swing[1]
    amplitude_rad_s = math.hypot(swing[1], swing[0] * math.sqrt(k / j))
    assert amplitude_rad_s == pytest.approx(pulse.added_rate_rad_s(SPRING), rel=0.25)  # 12 ms: a third of a period
    assert pulse.added_rate_rad_s(SPRING) >= amplitude_rad_s  # the estimate is the most


def test_what_a_pulse_left_decays_on_a_spring_and_coasts_without_one() -> None:
    now, later = Pulse(0.0, 0.01, 0.1), Pulse(2.0, 0.01, 0.1)
    assert later.added_rate_rad_s(SPRING) == pytest.approx(now.added_rate_rad_s(SPRING) * math.exp(-2 * 0.045 / 0.04))
    assert now.added_travel_rad(SPRING) == pytest.approx(now.added_rate_rad_s(SPRING) / math.sqrt(677.3 / 0.02))
    assert now.added_travel_rad(FREE) == 0.0
    assert later.added_travel_rad(FREE) == pytest.approx(0.1 / 0.1 * (1 - math.exp(-2.0 * 0.1 / 0.5)))
    undamped = Platform(0.5, 0.0, 0.0, terms=("inertia",))
    assert later.added_travel_rad(undamped) == pytest.approx(2.0 * 0.1 / 0.5)


class OnceLate(VirtualClock):
    """Wakes once 16 ms after the deadline, at 0.25 s of a set that begins about half a second in."""

    def wait_until(self, time_s: float) -> float:
        if time_s > 0.65 and self.now_s() < 0.65:
            time_s += 0.016
        return super().wait_until(time_s)


@pytest.mark.parametrize(("clock", "is_late"), [(VirtualClock(), False), (OnceLate(), True)])
def test_the_sequencer_names_its_own_pause_before_a_declared_number(clock: VirtualClock, is_late: bool) -> None:
    def fast(now_s: float) -> Exchange | None:
        return Exchange((GyroSample(now_s, math.radians(500), True),), ()) if now_s > 0.6995 else None

    steep = planned((Sine(torque_nm=60, frequency_hz=4.0, duration_s=2.0),))
    declared = Platform(0.02, 0.045, 677.3)
    sequencer = Sequencer(
        ScriptedRig(fast), clock, Guard(LimitsConfig()), sample_rate_hz=1000, rest_s=0.2, declared=declared
    )  # fmt: skip
    said = str(sequencer.play(steep).cause)
    assert "rate (limits.rate_deg_s): 500 deg/s at" in said
    assert ("this computer was 16.0 ms late 0.0" in said) == is_late
    assert ("the declared stiffness may be too large" in said) != is_late
