"""Work side by side: in its order, shared objects the same, failures heard, and over when it is interrupted."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from identify.likelihood.workers import FORKS, Workers

forked = pytest.mark.skipif(
    not FORKS or len(os.sched_getaffinity(0)) < Workers.AT_ONCE, reason="needs a system that forks, and two cores"
)


def met() -> Callable[[], None]:
    """What a task of either process calls to wait for one of the other."""
    barrier = multiprocessing.get_context("fork").Barrier(2)

    def wait() -> None:
        barrier.wait(timeout=30.0)

    return wait


@dataclass(frozen=True)
class Found:
    recording: object
    number: int


def test_tasks_come_back_in_their_order_with_parts_of_their_own() -> None:
    workers = Workers()

    def fit(k: int) -> Callable[[], int]:
        return lambda: sum(workers.map(lambda x: k * x, range(100)))

    assert workers.side_by_side([fit(k) for k in range(5)]) == [k * 4950 for k in range(5)]
    assert workers.each(lambda k: k**2, range(7)) == [0, 1, 4, 9, 16, 25, 36]
    assert workers.each(lambda k: k**2, []) == []


@forked
def test_tasks_run_in_two_processes_and_shared_objects_come_back_as_the_same() -> None:
    recording, other, meet = object(), [1.0], met()
    workers = Workers([recording])

    def fit(number: int) -> tuple[int, Found, list[float]]:
        meet()
        return os.getpid(), Found(recording, number), other

    found = workers.each(fit, (1, 2))

    assert [f.number for _, f, _ in found] == [1, 2]
    assert all(f.recording is recording for _, f, _ in found)
    (mine,) = (own for pid, _, own in found if pid == os.getpid())
    (theirs,) = (own for pid, _, own in found if pid != os.getpid())
    assert mine is other
    assert theirs == other and theirs is not other


@forked
def test_beside_a_task_that_takes_long_the_other_process_does_all_others() -> None:
    meet = met()

    def task(k: int) -> int:
        if k in (0, 5):  # the first goes on until the last has begun
            meet()
        return os.getpid()

    found = Workers().each(task, range(6))
    assert len(set(found[1:])) == 1
    assert found[0] != found[1]


@forked
def test_what_fails_in_the_other_process_is_raised_in_this_one() -> None:
    meet, here = met(), os.getpid()

    waited: list[int] = []

    def unreadable(k: int) -> int:
        if not waited:
            waited.append(k)
            meet()
            if os.getpid() == here:
                return k
        raise OSError("cannot be read")

    with pytest.raises(OSError, match="cannot be read"):
        Workers().each(unreadable, (0, 1))


@forked
def test_tasks_of_a_process_that_is_killed_are_done_in_this_one() -> None:
    meet, here = met(), os.getpid()
    waited: list[int] = []

    def killed(k: int) -> tuple[int, int]:
        if os.getpid() != here:
            meet()
            os.kill(os.getpid(), 9)
        if not waited:
            waited.append(k)
            meet()
        return k, os.getpid()

    assert Workers().each(killed, (0, 1, 2)) == [(0, here), (1, here), (2, here)]


@forked
def test_what_cannot_be_sent_is_done_here() -> None:
    found = Workers().each(lambda k: lambda: k, (3, 4))
    assert [f() for f in found] == [3, 4]


@forked
def test_an_interruption_ends_the_other_process_and_leaves_the_workers_usable(tmp_path: Path) -> None:
    workers, started = Workers(), tmp_path / "pid"

    def endless() -> int:
        started.write_text(str(os.getpid()))
        while True:
            list(workers.map(abs, (1, 2)))

    def interrupted() -> int:
        while not (started.exists() and started.read_text()):
            time.sleep(0.001)
        raise KeyboardInterrupt

    here = os.getpid()
    with pytest.raises(KeyboardInterrupt):
        workers.side_by_side([lambda: interrupted() if os.getpid() == here else endless()] * 2)
    with pytest.raises(ProcessLookupError):
        os.kill(int(started.read_text()), 0)
    assert workers.side_by_side([lambda: 1, lambda: 2]) == [1, 2]
