"""Each limit trips when it is broken, names itself, and leaves everything below it alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest

from rig.config.limits import LimitsConfig
from rig.guard import Guard, Rest, Tick, Trip
from rig.interface import GyroSample, TorqueSample

PERIOD_S = 1e-3
LIMITS = LimitsConfig(travel_deg=10, rate_deg_s=400, torque_nm=350)


def ticks(
    seconds: float, rate_deg_s: Callable[[float], float], valid: Callable[[float], bool] = lambda t: True
) -> Iterator[Tick]:
    for k in range(round(seconds / PERIOD_S)):
        t = k * PERIOD_S
        sample = GyroSample(t, math.radians(rate_deg_s(t)), valid(t))
        yield Tick(t, 0.0, PERIOD_S, 0.0, (sample,), (), {})


def first_trip(guard: Guard, run: Iterator[Tick]) -> Trip | None:
    return next((trip for tick in run if (trip := guard.look(tick)) is not None), None)


def ring(amplitude_deg: float, hz: float) -> Callable[[float], float]:
    w = 2 * math.pi * hz
    return lambda t: amplitude_deg * w * math.cos(w * t)


def test_a_swing_within_all_limits_passes() -> None:
    assert first_trip(Guard(LIMITS), ticks(2.0, ring(9.0, 3.0))) is None


def test_travel_is_integrated_from_the_rate_and_trips_where_it_is_reached() -> None:
    trip = first_trip(Guard(LIMITS), ticks(2.0, lambda t: 20.0 + 1e-6 * t))
    assert trip is not None
    assert trip.limit.startswith("travel (limits.travel_deg")
    assert trip.value == pytest.approx(10.0, abs=0.05)
    assert trip.time_s == pytest.approx(0.5, abs=0.002)
    assert "allowed is 10 deg" in str(trip)


def test_a_bias_known_from_the_rest_does_not_count_as_travel() -> None:
    biased = Guard(LIMITS)
    assert first_trip(biased, ticks(10.0, lambda t: 2.0 + 1e-9 * t)) is not None
    biased.begin(0.0, Rest(bias_rad_s=math.radians(2.0)))
    assert first_trip(biased, ticks(10.0, lambda t: 2.0 + 1e-9 * t)) is None


def test_an_uncertain_bias_takes_its_drift_off_the_travel_allowed() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.0, Rest(bias_sigma_rad_s=math.radians(0.1)))
    trip = first_trip(guard, ticks(10.0, ring(9.0, 1.0)))
    assert trip is not None
    assert trip.time_s == pytest.approx(1.0 / 0.3, abs=0.5)  # 9 deg + 3 x 0.1 deg/s x t reaches 10 deg
    assert "drifted" in trip.limit


def test_travel_goes_on_across_samples_that_were_lost() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: 20.0 + 1e-6 * t, lambda t: round(t * 1e3) % 10 == 0))
    assert trip is not None
    assert trip.time_s == pytest.approx(0.5, abs=0.01)


def test_a_rate_above_the_limit_trips_at_once() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: 0.0 if t < 0.1 - 1e-9 else 401.0 + t))
    assert trip is not None
    assert (trip.limit, trip.time_s) == ("rate (limits.rate_deg_s)", pytest.approx(0.1))


def test_a_sample_clipped_at_the_limit_trips_although_it_is_invalid() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: 400.0, lambda t: False))
    assert trip is not None
    assert trip.limit == "rate (limits.rate_deg_s)"


def test_a_gyro_that_falls_silent_is_stale() -> None:
    guard = Guard(LIMITS)
    silent = (Tick(k * PERIOD_S, 0.0, PERIOD_S, 0.0, (), (), {}) for k in range(1000))
    trip = first_trip(guard, silent)
    assert trip is not None
    assert trip.limit.startswith("gyro stale")
    assert trip.time_s == pytest.approx(LIMITS.stale_gyro_ms / 1e3, abs=2.5e-3)


def test_a_gyro_that_sends_only_invalid_samples_is_stale_too() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: math.nan, lambda t: False))
    assert trip is not None
    assert trip.limit.startswith("gyro stale")


def test_a_gyro_that_repeats_itself_is_frozen() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: 3.0))
    assert trip is not None
    assert trip.limit.startswith("gyro frozen")
    assert trip.time_s == pytest.approx(0.1, abs=2e-3)


def test_the_frozen_check_can_be_switched_off_by_name() -> None:
    limits = LIMITS.model_copy(update={"frozen_gyro_ms": None})
    assert first_trip(Guard(limits), ticks(1.0, lambda t: 3.0)) is None


def test_missed_ticks_trip_only_when_they_come_in_a_row() -> None:
    def late(every: int) -> Iterator[Tick]:
        for k in range(0, 4000, 3):
            t = k * PERIOD_S
            sample = GyroSample(t, 1e-3 * (k % 2), True)
            yield Tick(t, 2 * PERIOD_S if k % every else 0.0, PERIOD_S, 0.0, (sample,), (), {})

    assert first_trip(Guard(LIMITS), late(every=6)) is None
    trip = first_trip(Guard(LIMITS), late(every=5000))
    assert trip is not None
    assert trip.limit.startswith("missed ticks")
    assert trip.value == 22


def test_a_torque_beyond_the_limit_is_not_permitted() -> None:
    guard = Guard(LIMITS)
    assert guard.permit(-350.0, 0.0, 0.0) is None
    trip = guard.permit(-350.1, 0.0, 0.0)
    assert trip is not None
    assert "It was not sent" in str(trip)


def test_a_torque_that_is_not_a_number_is_not_permitted() -> None:
    assert Guard(LIMITS).permit(math.nan, 0.0, 0.0) is not None


def test_no_torque_is_permitted_after_a_stall() -> None:
    guard = Guard(LIMITS)
    assert guard.permit(0.0, 1.0, 0.049) is None
    trip = guard.permit(0.0, 1.0, 0.051)
    assert trip is not None
    assert trip.limit.startswith("stall or clock jump")


def test_a_drive_that_applies_more_than_the_limit_trips() -> None:
    tick = Tick(0.0, 0.0, PERIOD_S, 10.0, (), (TorqueSample(0.0, 400.0),), {})
    trip = Guard(LIMITS).look(tick)
    assert trip is not None
    assert trip.limit.startswith("applied torque")


def test_times_of_a_trip_count_from_the_start_of_the_set() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.05, Rest())
    trip = first_trip(guard, ticks(1.0, lambda t: 0.0 if t < 0.1 - 1e-9 else 500.0))
    assert trip is not None
    assert trip.time_s == pytest.approx(0.05)


def with_channels(**channels: float) -> Tick:
    return Tick(0.5, 0.0, PERIOD_S, 0.0, (GyroSample(0.5, 1e-4, True),), (), channels)


def test_a_hot_drive_trips_only_where_a_limit_is_given() -> None:
    hot = with_channels(drive_temperature_c=91.0, drive_current_a=12.0)
    easy, strict = Guard(LIMITS), Guard(LimitsConfig(drive_temperature_c=85, drive_current_a=20))
    for guard in (easy, strict):
        guard.begin(0.49, Rest())
    assert easy.look(hot) is None
    trip = strict.look(hot)
    assert trip is not None
    assert (trip.limit, trip.value, trip.allowed) == ("temperature of the drive (limits.drive_temperature_c)", 91.0, 85)


def test_the_current_of_the_drive_counts_in_either_direction() -> None:
    guard = Guard(LimitsConfig(drive_current_a=20))
    guard.begin(0.49, Rest())
    trip = guard.look(with_channels(drive_current_a=-21.0))
    assert trip is not None
    assert "limits.drive_current_a" in trip.limit


def test_an_encoder_counts_travel_from_where_it_stood_at_rest() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.49, Rest())
    assert guard.look(with_channels(angle_rad=1.0)) is None
    assert guard.look(with_channels(angle_rad=1.0 + math.radians(9.9))) is None
    trip = guard.look(with_channels(angle_rad=1.0 - math.radians(10.1)))
    assert trip is not None
    assert trip.limit == "travel by the encoder (limits.travel_deg)"
