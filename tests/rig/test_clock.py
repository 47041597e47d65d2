"""Two clocks with one contract."""

from __future__ import annotations

import pytest

from rig.clock import Clock, MonotonicClock, VirtualClock


@pytest.mark.parametrize("clock", [MonotonicClock(), MonotonicClock(spin_s=2e-4), VirtualClock(7.0)])
def test_a_clock_wakes_at_its_deadline_or_later_and_never_runs_backwards(clock: Clock) -> None:
    start = clock.now_s()
    deadlines = [start + 0.002, start + 0.001, start + 0.004]
    woken = [clock.wait_until(d) for d in deadlines]
    assert all(w >= d for w, d in zip(woken, deadlines, strict=True))
    assert woken == sorted(woken)
    assert clock.now_s() >= woken[-1]


def test_a_virtual_hour_passes_at_once() -> None:
    clock = VirtualClock()
    assert clock.wait_until(3600.0) == 3600.0


def test_a_virtual_clock_can_be_late_on_purpose() -> None:
    clock = VirtualClock(late_s=lambda deadline: 0.25 if deadline == 1.0 else 0.0)
    assert clock.wait_until(0.5) == 0.5
    assert clock.wait_until(1.0) == 1.25
    assert clock.wait_until(1.1) == 1.25
