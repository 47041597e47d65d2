"""Before torque is possible, everything that the guarded loop calls has been called once."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from types import CodeType, FrameType

import pytest

from rig.config.limits import LimitsConfig
from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.guard.base import Rest, Tick
from rig.guard.motion import motion_checks
from rig.interface import GyroSample, TorqueSample
from rig.platform import Platform
from rig.sequencer.warm_up import warm_up

LIMITS = LimitsConfig(travel_deg=10, rate_deg_s=400, torque_nm=150)
DECLARED = Platform(0.02, 0.06, 680.0)
SETS: list[PlannedSet] = []

# Locked memory pages whatever is newly allocated in at once: 32 MB, 8192 pages, by the first matrix product.
FAULTS = """
import resource
from rig import realtime
from rig.sequencer.warm_up import warm_up
from tests.rig.sequencer.test_warm_up import DECLARED, LIMITS, SETS, moving_ticks, new_guard
warm_up(new_guard(), DECLARED, SETS, 1000.0)
guard, ticks = new_guard(), moving_ticks()
grant = realtime.acquire(0, lock_memory=True)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for tick in ticks:
    guard.look(tick)
print(int(grant.memory_locked), resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def new_guard() -> Guard:
    return Guard(LIMITS, motion_checks(LIMITS, DECLARED))


def moving_ticks() -> list[Tick]:
    """Half a second of a jump in rate every 20 ms: no motion of this platform, so checks look twice."""
    ticks = []
    for i in range(1, 500):
        rate = 0.01 * ((i // 20) % 3 - 1) + 1e-5 * (i % 7)
        now_s = i * 1e-3
        ticks.append(Tick(now_s, 0.0, 1e-3, rate, (GyroSample(now_s, rate, True),), (TorqueSample(now_s, rate),), {}))
    return ticks


def called(action: Callable[[], object]) -> set[CodeType]:
    """The code of every function of the guard that runs meanwhile."""
    seen: set[CodeType] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and "guard" in frame.f_code.co_filename:
            seen.add(frame.f_code)

    sys.setprofile(note)
    try:
        action()
    finally:
        sys.setprofile(None)
    return seen


def test_the_guard_runs_nothing_for_the_first_time_in_the_loop() -> None:
    guard = new_guard()
    guard.begin(0.0, Rest())
    in_the_loop = called(lambda: [guard.look(tick) for tick in moving_ticks()])
    warmed_up = called(lambda: warm_up(new_guard(), DECLARED, SETS, 1000.0))
    assert len(in_the_loop) > 20
    assert {code.co_qualname for code in in_the_loop - warmed_up} <= {"Check._trip", "Trip.__init__"}


def test_an_easy_motion_of_the_declared_platform_trips_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    verdicts: list[object] = []
    look = Guard.look
    monkeypatch.setattr(Guard, "look", lambda self, tick: verdicts.append(look(self, tick)))
    warm_up(new_guard(), DECLARED, SETS, 1000.0)
    assert len(verdicts) > 400
    assert set(verdicts) == {None}


@pytest.mark.skipif(sys.platform != "linux", reason="locked memory is Linux's")
def test_no_large_piece_of_memory_is_paged_in_by_the_first_ticks() -> None:
    done = subprocess.run([sys.executable, "-c", FAULTS], capture_output=True, text=True, timeout=60, check=True)
    locked, faults = map(int, done.stdout.split())
    if not locked:
        pytest.skip("this machine lets nobody lock memory")
    assert faults < 500
