"""Real-time priority: what was got is said, and nobody who holds the interpreter's lock can be kept from running."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from rig import realtime

if sys.platform != "linux":
    pytest.skip("schedulers of this kind are Linux's", allow_module_level=True)


def test_threads_that_were_there_are_lifted_with_the_loop_and_come_down_again() -> None:
    end, begun = threading.Event(), threading.Event()
    ids: list[int] = []

    def wait() -> None:
        ids.append(threading.get_native_id())
        begun.set()
        end.wait(10.0)

    helper = threading.Thread(target=wait)
    helper.start()
    begun.wait(5.0)
    try:
        grant = realtime.acquire(2, lock_memory=False)
        lifted = os.sched_getscheduler(ids[0])
        realtime.release()
        after = os.sched_getscheduler(ids[0])
    finally:
        end.set()
        helper.join()
    if not grant.priority:
        pytest.skip(f"no real-time priority here: {grant}")
    assert (lifted, after) == (os.SCHED_FIFO, os.SCHED_OTHER)
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
