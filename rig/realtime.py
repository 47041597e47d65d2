"""Real-time priority and locked memory for the calling thread, and what of it was granted."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE = 1, 2
MAX_THREAD_WAIT_S = 50e-6  # how long the loop waits at most for another thread of ours to leave the interpreter to it
_usual_hand_over_s = sys.getswitchinterval()
_lifted: list[int] = []


@dataclass(frozen=True)
class RealTimeGrant:
    """What the operating system granted. ``priority`` 0 means ordinary scheduling."""

    priority: int
    memory_locked: bool
    fine_timers: bool
    refused: tuple[str, ...] = ()

    def __str__(self) -> str:
        got = [f"real-time priority {self.priority} (FIFO)" if self.priority else "ordinary scheduling"]
        got += ["memory locked"] if self.memory_locked else []
        got += ["timer slack 1 ns"] if self.fine_timers else []
        return ", ".join(got) + (f"; not granted: {'; '.join(self.refused)}" if self.refused else "")


def _libc() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(None, use_errno=True)
    except (OSError, TypeError):
        return None  # Windows


def _first_in_first_out(priority: int) -> str:
    """Empty when granted, else why not."""
    if sys.platform == "win32" or not hasattr(os, "sched_setscheduler"):
        return "real-time priority (not available on this system)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as problem:
        return (
            f"real-time priority {priority} ({problem.strerror}; allow it with an `rtprio` line for your user "
            "in /etc/security/limits.conf)"
        )
    return ""


def _lift_helpers(priority: int) -> None:
    """Threads that were there before come just below the loop.

    Whoever holds the interpreter's lock and has to wait for a processor lets the loop wait with it; among ordinary
    programs on a busy machine that takes tens of milliseconds.
    """
    try:
        others = [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
    except OSError:
        return
    for thread in others:
        if thread != threading.get_native_id() and thread not in _lifted:
            with contextlib.suppress(OSError, ValueError):  # it may have ended meanwhile
                if os.sched_getscheduler(thread) == os.SCHED_OTHER:
                    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
                    _lifted.append(thread)


def acquire(priority: int, lock_memory: bool) -> RealTimeGrant:
    """Ask for what keeps a tick on time; never fails, but says what was refused.

    The collector of cyclic garbage is frozen too: what exists by now is not looked at again, so that a
    collection in the loop takes microseconds instead of milliseconds.
    """
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(MAX_THREAD_WAIT_S)
    refused = []
    libc = _libc()
    fine_timers = bool(libc and hasattr(libc, "prctl") and libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0)
    locked = False
    if lock_memory:
        locked = bool(libc and hasattr(libc, "mlockall") and libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0)
        refused += [] if locked else ["locked memory (raise `memlock` in /etc/security/limits.conf)"]
    problem = _first_in_first_out(priority) if priority else ""
    refused += [problem] if problem else []
    granted = priority if priority and not problem else 0
    if granted and sys.platform == "linux":
        _lift_helpers(max(granted - 1, 1))
    return RealTimeGrant(granted, locked, fine_timers, tuple(refused))


def release() -> None:
    """Back to ordinary scheduling, so that what follows the campaign does not starve the machine."""
    if sys.platform != "win32" and hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):  # where a thread may not lower itself it was never raised
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        while _lifted:
            with contextlib.suppress(OSError, ValueError):
                os.sched_setscheduler(_lifted.pop(), os.SCHED_OTHER, os.sched_param(0))
    libc = _libc()
    if libc is not None and hasattr(libc, "munlockall"):
        libc.munlockall()
    sys.setswitchinterval(_usual_hand_over_s)
    gc.unfreeze()
