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
    biased.origin()
    biased.begin(0.0, Rest(bias_rad_s=math.radians(2.0)))
    assert first_trip(biased, ticks(10.0, lambda t: 2.0 + 1e-9 * t)) is None


def test_an_uncertain_bias_takes_its_drift_off_the_travel_allowed() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.0, Rest(bias_sigma_rad_s=math.radians(0.1)))
    trip = first_trip(guard, ticks(10.0, ring(9.0, 1.0)))
    assert trip is not None
    assert trip.time_s == pytest.approx(1.0 / 0.3, abs=0.5)  # 9 deg + 3 x 0.1 deg/s x t reaches 10 deg
    assert "possible drift" in trip.limit


def test_travel_goes_on_across_samples_that_were_lost() -> None:
    trip = first_trip(Guard(LIMITS), ticks(1.0, lambda t: 20.0 + 1e-6 * t, lambda t: round(t * 1e3) % 10 == 0))
    assert trip is not None
    assert trip.time_s == pytest.approx(0.5, abs=0.01)


def walk(from_s: float, rate_deg_s: Callable[[float], float], guard: Guard, seconds: float = 1.0) -> Trip | None:
    """The first trip over so many seconds of this rate, the samples with a little noise."""
    run = ticks(seconds, lambda t: rate_deg_s(t) + 1e-3 * math.sin(1e4 * t))
    moved = (
        tick._replace(now_s=tick.now_s + from_s, gyro=[s._replace(time_s=s.time_s + from_s) for s in tick.gyro])
        for tick in run
    )
    return first_trip(guard, moved)


def test_what_every_set_leaves_behind_adds_up_to_the_travel() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.0, Rest(noise_rad_s=1e-5))
    assert walk(0.0, lambda t: 6.4, guard) is None
    guard.begin(1.0, Rest(noise_rad_s=1e-5))
    trip = walk(1.0, lambda t: 6.4, guard)
    assert trip is not None
    assert "start of the campaign" in str(trip)
    assert trip.time_s == pytest.approx(3.6 / 6.4, abs=0.01)


def test_a_new_campaign_counts_from_where_the_platform_stands() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.0, Rest())
    assert walk(0.0, lambda t: 6.4, guard) is None
    guard.origin()
    guard.begin(1.0, Rest())
    assert walk(1.0, lambda t: 6.4, guard) is None


def test_a_bias_that_creeps_from_rest_to_rest_is_no_travel() -> None:
    guard = Guard(LIMITS)
    for k in range(20):
        creep = 0.004 * k
        guard.begin(10.0 * k, Rest(math.radians(creep), math.radians(0.002), math.radians(0.05)))
        assert walk(10.0 * k, lambda t, creep=creep: creep + 0.0004 * t, guard, 10.0) is None  # type: ignore[misc]


def test_a_platform_that_coasts_through_the_rest_is_not_taken_for_a_bias_of_the_gyro() -> None:
    guard = Guard(LIMITS)
    guard.begin(0.0, Rest(noise_rad_s=1e-5))
    assert walk(0.0, lambda t: 0.8, guard, 9.0) is None
    guard.begin(9.0, Rest(bias_rad_s=math.radians(0.8), noise_rad_s=1e-5))
    trip = walk(9.0, lambda t: 3.0, guard, 9.0)
    assert trip is not None
    assert trip.time_s == pytest.approx((10.0 - 9.0 * 0.8) / 2.2, abs=0.05)


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


def falls_silent(at_s: float, late: Callable[[float], bool]) -> Iterator[Tick]:
    """Late by 12 ms at the instants asked for."""
    for tick in ticks(0.1, ring(1.0, 2.0)):
        heard = tick if tick.now_s < at_s else tick._replace(gyro=())
        yield heard._replace(late_s=0.012) if late(tick.now_s) else heard


def test_a_gyro_that_is_stale_on_a_late_machine_points_at_the_machine_first() -> None:
    on_time = first_trip(Guard(LIMITS), falls_silent(0.02, lambda t: False))
    late = first_trip(Guard(LIMITS), falls_silent(0.02, lambda t: 0.0245 < t < 0.0255))
    assert on_time is not None and late is not None
    assert on_time.limit == late.limit and late.limit.startswith("gyro stale")
    assert on_time.what_to_do.startswith("No valid gyro sample arrived: check the cable and supply")
    assert late.what_to_do.startswith("This computer is too slow: it was 12.0 ms late")


def test_lateness_before_the_last_valid_sample_does_not_count_against_the_machine() -> None:
    trip = first_trip(Guard(LIMITS), falls_silent(0.02, lambda t: t < 0.0005))
    assert trip is not None and trip.limit.startswith("gyro stale")
    assert "This computer" not in trip.what_to_do


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


def test_an_encoders_angle_is_not_forgotten_between_sets() -> None:
    guard = Guard(LIMITS)
    for k in range(2):
        guard.begin(0.49, Rest())
        for step in range(7):
            trip = guard.look(with_channels(angle_rad=1.0 + math.radians(6.0 * k + step)))
    assert trip is not None
    assert trip.limit == "travel by the encoder (limits.travel_deg)"
    assert trip.value == pytest.approx(12.0)


def encoder_says(angle_rad: Callable[[float], float], seconds: float = 1.0) -> Trip | None:
    run = ticks(seconds, lambda t: 1e-3 * math.sin(1e4 * t))
    return first_trip(Guard(LIMITS), (tick._replace(channels={"angle_rad": angle_rad(tick.now_s)}) for tick in run))


def test_an_encoder_without_a_reading_now_and_then_is_read_on() -> None:
    trip = encoder_says(lambda t: math.nan if t % 0.1 < 0.09 else math.radians(20.0 * t))
    assert trip is not None
    assert trip.limit.startswith("travel by the encoder")


@pytest.mark.parametrize("from_s", [0.0, 0.3])
def test_an_encoder_that_says_nothing_any_more_trips(from_s: float) -> None:
    trip = encoder_says(lambda t: math.nan if t >= from_s else 0.1)
    assert trip is not None
    assert trip.limit == "no angle from the encoder"
    assert trip.time_s == pytest.approx(from_s + 0.1, abs=0.003)
