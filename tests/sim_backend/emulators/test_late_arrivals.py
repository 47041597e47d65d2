"""Frames that waited while the machine kept the emulators from running count from when they were sent."""

import itertools

import pytest

from sim_backend.emulators.late_arrivals import ArrivalTimes

TICK = b"t2014AAAA\rt0800\r"


def used_to_a_tick_each_millisecond() -> ArrivalTimes:
    arrivals = ArrivalTimes()
    for k in range(100):
        arrivals.pieces(TICK, 1e-3 * k - 2e-4, 1e-3 * k)
    return arrivals


def test_what_is_found_in_time_came_now() -> None:
    pieces = used_to_a_tick_each_millisecond().pieces(TICK, 0.0995, 0.1)
    assert [(p.time_s, p.data) for p in pieces] == [(0.1, TICK)]


def test_thirteen_ticks_of_a_pause_are_spread_over_it() -> None:
    pieces = used_to_a_tick_each_millisecond().pieces(13 * TICK, 0.099, 0.112)
    assert b"".join(p.data for p in pieces) == 13 * TICK
    set_points = [p.time_s for p in pieces if p.data.startswith(b"t201")]
    assert [b - a for a, b in itertools.pairwise(set_points)] == pytest.approx([1e-3] * 12, rel=0.02)
    assert pieces[0].time_s > 0.099
    assert pieces[-1].time_s == pytest.approx(0.112)


def test_more_frames_than_usual_still_lie_within_the_pause() -> None:
    pieces = used_to_a_tick_each_millisecond().pieces(40 * TICK, 0.099, 0.109)
    assert min(p.time_s for p in pieces) > 0.099


def test_one_tick_after_a_long_pause_of_both_came_just_now() -> None:
    pieces = used_to_a_tick_each_millisecond().pieces(TICK, 0.099, 0.199)
    assert min(p.time_s for p in pieces) > 0.198


def test_half_a_line_stays_for_the_next_read() -> None:
    pieces = used_to_a_tick_each_millisecond().pieces(2 * TICK + b"t201", 0.099, 0.105)
    assert pieces[-1].data == b"t201"
    assert pieces[-1].time_s == pytest.approx(0.105)
