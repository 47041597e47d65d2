"""What is recorded is stamped by a straight line, whatever the running map did while it learnt."""

import math

import numpy as np
import pytest

from drivers.amplifiers.torque_clock import TorqueClock
from drivers.timing.retiming import MAX_CORRECTION_S, OWN_LINE, ClockRetiming
from drivers.timing.source_clock import SourceClock

START_S = 1000.0
SETTLE_S, SET_S, REST_S = 4.0, 5.0, 3.0


def phases(sets=4):
    """(begin, end, rate of the ticks, whether a set plays) of a little campaign."""
    at, found = START_S, []
    for length, hz, plays in [(SETTLE_S, 500, False), *[(SET_S, 1000, True), (REST_S, 100, False)] * sets]:
        found.append((at, at + length, hz, plays))
        at += length
    return found


def roads(rng, n, plays):
    """There and back: in a rest the processor goes to sleep between two ticks, and both ways get slower."""
    there = 60e-6 + rng.exponential(20e-6, n) + (0.0 if plays else 15e-6)
    back = 50e-6 + rng.exponential(40e-6, n) + (0.0 if plays else 180e-6)
    late = rng.random(n) < 0.02
    return there, back + late * rng.exponential(3e-3, n)


def play_drive(clock, drift, seed, sets=4, slower_by_s=0.0):
    """Per set: (recorded, really applied) times of every torque."""
    rng, played = np.random.default_rng(seed), []
    for number, (begin, end, hz, plays) in enumerate(phases(sets)):
        asked = np.arange(begin, end, 1.0 / hz)
        there, back = roads(rng, len(asked), plays)
        applied = asked + there + number * slower_by_s
        heard = np.maximum.accumulate(applied + back + number * slower_by_s)
        if plays:
            clock.retiming.begin_set(begin)
        recorded = []
        for k in range(len(asked)):
            clock.asked(asked[k])
            stamp = int((applied[k] + 50.0) * (1 + drift) * 1e6) & 0xFFFFFFFF
            recorded.append(clock.received(stamp, heard[k]))
            clock.retiming.end_tick()
        if plays:
            clock.retiming.end_set()
            played.append((np.array(recorded), applied))
    return played


def play_gyro(clock, hindsight, drift, seed, bend=0.0, rate_hz=1000.0, played=None):
    """Per set: (recorded, true) times of every sample; the clock's drift grows by ``bend`` a second."""
    rng, found = np.random.default_rng(seed), []
    count = 0
    for begin, end, _, plays in played or phases():
        taken = START_S + np.arange(count + 1, count + 1 + round((end - begin) * rate_hz)) / rate_hz
        count += len(taken)
        since = taken - START_S
        taken = taken + drift * since + 0.5 * bend * since**2
        late = 30e-6 + rng.exponential(40e-6, len(taken)) + (10e-6 if plays else 0.0)
        if plays:
            hindsight.begin_set(begin)
        recorded = []
        for k, true_s in enumerate(taken.tolist()):
            n = count - len(taken) + 1 + k
            clock.observe(n, true_s + late[k])
            hindsight.observe(n * clock.period_s, true_s + late[k])
            recorded.append(clock.host_time_s(n))
            hindsight.record(recorded[-1], n * clock.period_s, clock.fits)
            hindsight.end_tick()
        if plays:
            hindsight.end_set()
            found.append((np.array(recorded), taken))
    return found


def errors(retimed, played):
    """Of every stamp of every set, in s, as the recording has it afterwards."""
    found = []
    for one, (recorded, true) in zip(retimed, played, strict=True):
        better = recorded + np.interp(recorded, one.recorded_s, one.refined_s - one.recorded_s)
        assert np.all(np.diff(better) > 0.0)
        found.append(better - true)
    return found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("drift", [-80e-6, 0.0, 30e-6])
def test_a_drives_stamps_lie_on_one_straight_line_and_none_is_late(drift, seed):
    clock = TorqueClock(1e-6, 1 << 32)
    played = play_drive(clock, drift, seed)
    found = errors(clock.retiming.retimed_sets(), played)
    every = np.concatenate(found)
    assert np.max(every) <= 0.0, "a torque was stamped later than it acted"
    assert np.ptp(every) < 6e-6
    assert np.mean(every) == pytest.approx(-65e-6, abs=15e-6), "what is left is the way there"


def test_a_machine_that_becomes_slower_on_both_ways_bends_no_drives_clock():
    clock = TorqueClock(1e-6, 1 << 32)
    played = play_drive(clock, 30e-6, 5, slower_by_s=3e-6)
    every = np.concatenate(errors(clock.retiming.retimed_sets(), played))
    assert np.ptp(every) < 8e-6, "although the ways there and back grew by 24 us each"


@pytest.mark.parametrize("seed", range(3))
def test_a_gyros_stamps_lie_on_one_straight_line_and_none_is_early(seed):
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    played = play_gyro(clock, hindsight, 20e-6, seed)
    before = [np.ptp(recorded - true) for recorded, true in played]
    every = np.concatenate(errors(hindsight.retimed_sets(), played))
    assert np.min(every) >= 0.0
    assert np.ptp(every) < 4e-6 < max(before)


def test_a_set_of_minutes_follows_a_crystal_that_warms_up():
    clock = SourceClock(5e-3)
    hindsight = ClockRetiming(clock)
    one = [(START_S, START_S + 4.0, 0, False), (START_S + 4.0, START_S + 304.0, 0, True)]
    played = play_gyro(clock, hindsight, 20e-6, 1, bend=2e-9, rate_hz=200.0, played=one)
    (error_s,) = errors(hindsight.retimed_sets(), played)
    assert np.ptp(error_s) < 12e-6, "a single line would be 22 us off"


def test_the_delay_that_was_taken_off_stays_off():
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    play_gyro(clock, hindsight, 20e-6, 2)
    for plain, delayed in zip(hindsight.retimed_sets(), hindsight.retimed_sets(2e-3), strict=True):
        np.testing.assert_allclose(plain.refined_s - delayed.refined_s, 2e-3, atol=1e-9)


def test_a_drive_that_is_never_asked_is_stamped_by_its_answers_alone():
    clock = TorqueClock(1e-6, 1 << 32)
    clock.asked = lambda at_s: None
    played = play_drive(clock, 30e-6, 3)
    every = np.concatenate(errors(clock.retiming.retimed_sets(), played))
    assert np.ptp(every) < 25e-6
    assert np.min(every) > 0.0


def test_too_little_around_a_set_leaves_it_as_it_was():
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    play_gyro(
        clock, hindsight, 20e-6, 2, played=[(START_S, START_S + 1.0, 0, False), (START_S + 1.0, START_S + 2.0, 0, True)]
    )
    assert hindsight.retimed_sets() == []
    assert ClockRetiming(clock).retimed_sets() == []


def test_what_came_after_the_last_whole_tick_changes_nothing():
    found = []
    for further in (0, 3000):
        clock = TorqueClock(1e-6, 1 << 32)
        play_drive(clock, 30e-6, 7, sets=2)
        clock.retiming.begin_set(2000.0)
        for k in range(further):
            clock.received(int((1020.0 + k * 1e-3) * 1e6) & 0xFFFFFFFF, 1020.5 + k * 1e-3)
        clock.retiming.end_set()
        found.append(clock.retiming.retimed_sets())
    assert len(found[0]) == len(found[1]) == 2
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a.recorded_s, b.recorded_s)
        np.testing.assert_array_equal(a.refined_s, b.refined_s)


def test_maps_that_contradict_each_other_by_milliseconds_are_left_alone():
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    play_gyro(clock, hindsight, 20e-6, 2)
    hindsight.begin_set(2000.0)
    at = START_S + 40.0
    for k in range(100):
        hindsight.record(at + k * 1e-3 + 2 * MAX_CORRECTION_S, at - START_S + k * 1e-3, OWN_LINE)
    hindsight.end_tick()
    hindsight.end_set()
    assert len(hindsight.retimed_sets()) == 4


def test_stamps_that_were_pushed_on_keep_their_order():
    clock = TorqueClock(1e-6, 1 << 32)
    clock.retiming.begin_set(START_S)
    for k in range(8000):
        asked_s = START_S + k * 1e-3
        clock.asked(asked_s)
        taken_up_together = asked_s - (1e-3 if k % 50 == 1 else 0.0)
        clock.received(int(taken_up_together * 1e6) & 0xFFFFFFFF, asked_s + 150e-6)
        clock.retiming.end_tick()
    clock.retiming.end_set()
    (one,) = clock.retiming.retimed_sets()
    assert np.all(np.diff(one.recorded_s) > 0)
    assert np.all(np.diff(one.refined_s) > 0)


def test_a_device_that_starts_anew_is_learnt_anew():
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    play_gyro(clock, hindsight, 20e-6, 2)
    hindsight.reset(SourceClock(1e-3))
    assert hindsight.retimed_sets() == []


def test_a_few_points_a_second_are_kept_however_many_samples_come():
    clock = SourceClock(1e-3)
    hindsight = ClockRetiming(clock)
    play_gyro(clock, hindsight, 20e-6, 2)
    for one in hindsight.retimed_sets():
        assert len(one.recorded_s) <= 2 + 2 * math.ceil(SET_S / 0.25)


def test_of_a_long_day_the_last_readings_stay_and_the_last_sets_are_refined(monkeypatch):
    monkeypatch.setattr("drivers.timing.retiming.MAX_STORED_BLOCKS", 60)
    clock = SourceClock(5e-3)
    hindsight = ClockRetiming(clock)
    played = play_gyro(clock, hindsight, 20e-6, 2, rate_hz=200.0, played=phases(40))
    found = hindsight.retimed_sets()
    assert 0 < len(found) < len(played), "of the first sets nothing is known any more"
    assert np.ptp(errors(found, played[-len(found) :])[-1]) < 6e-6
