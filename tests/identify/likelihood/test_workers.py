"""Work side by side: in its order, shared objects the same, failures heard, and over when it is interrupted."""

from __future__ import annotations

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
    recording, other = object(), [1.0]
    workers = Workers([recording])

    def fit(number: int) -> tuple[int, Found, list[float]]:
        return os.getpid(), Found(recording, number), other

    (here, first, mine), (there, second, theirs) = workers.each(fit, (1, 2))

    assert here == os.getpid() != there
    assert first.recording is second.recording is recording
    assert (first.number, second.number) == (1, 2)
    assert mine is other
    assert theirs == other and theirs is not other


@forked
def test_what_fails_in_the_other_process_is_raised_in_this_one() -> None:
    def unreadable(k: int) -> int:
        if k == 1:
            raise OSError("cannot be read")
        return k

    with pytest.raises(OSError, match="cannot be read"):
        Workers().each(unreadable, (0, 1))


@forked
def test_tasks_of_a_process_that_is_killed_are_done_in_this_one() -> None:
    here = os.getpid()

    def killed(k: int) -> tuple[int, int]:
        if os.getpid() != here:
            os.kill(os.getpid(), 9)
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

    with pytest.raises(KeyboardInterrupt):
        workers.side_by_side([interrupted, endless])
    with pytest.raises(ProcessLookupError):
        os.kill(int(started.read_text()), 0)
    assert workers.side_by_side([lambda: 1, lambda: 2]) == [1, 2]
