"""A drive's stamps on the host's clock, whatever the roads there and back do."""

import numpy as np
import pytest

from drivers.amplifiers.torque_clock import TorqueClock

OFFSET_S, DRIFT = 50.0, 30e-6


def exchange(clock, there_s, back_s, ticks=12_000, together=()):
    """Ask and hear once a millisecond; errors of the time given to each stamp, in s."""
    errors = []
    for k in range(ticks):
        asked_s = 10.0 + k * 1e-3
        clock.asked(asked_s)
        if k in together:
            clock.asked(asked_s + 1e-5)
        taken_s = asked_s + there_s(k)
        stamp = int((taken_s + OFFSET_S) * (1 + DRIFT) * 1e6) & 0xFFFFFFFF
        errors.append(clock.received(stamp, taken_s + back_s(k)) - taken_s)
    return np.array(errors)


def test_what_is_left_is_the_way_there_whatever_the_way_back():
    for back_s in (20e-6, 80e-6, 400e-6):
        errors = exchange(TorqueClock(1e-6, 1 << 32), lambda k: 80e-6, lambda k, b=back_s: b)
        assert np.max(np.abs(errors[3000:] + 80e-6)) < 3e-6


def test_jitter_of_both_roads_is_seen_through():
    rng = np.random.default_rng(4)
    there, back = (60e-6 + rng.exponential(40e-6, 12_000) for _ in range(2))
    errors = exchange(TorqueClock(1e-6, 1 << 32), lambda k: there[k], lambda k: back[k])
    assert np.std(errors[3000:]) < 3e-6
    assert np.mean(errors[3000:]) == pytest.approx(-60e-6, abs=10e-6)


def test_two_questions_with_one_answer_do_not_count_as_a_short_road():
    clock = TorqueClock(1e-6, 1 << 32)
    exchange(clock, lambda k: 80e-6, lambda k: 80e-6, together=range(0, 12_000, 3))
    assert clock.way_s == pytest.approx(160e-6, abs=4e-6)


def test_an_answer_that_is_looked_at_after_the_next_request_still_finds_its_own():
    clock, waiting = TorqueClock(1e-6, 1 << 32), []
    for k in range(4000):
        asked_s = 10.0 + k * 1e-3
        clock.asked(asked_s)
        for answer in waiting:
            clock.received(*answer)
        waiting = [(int((asked_s + 80e-6) * 1e6), asked_s + 160e-6)]
    assert clock.way_s == pytest.approx(160e-6, abs=4e-6)


def test_times_never_stand_still():
    clock = TorqueClock(1e-6, 1 << 32)
    times = [clock.received(1000, 5.0) for _ in range(3)]
    assert np.all(np.diff(times) > 0)
