"""Hands campaigns to workers and takes in what comes back, whoever the workers are and whatever ends them."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol

from commands.identify_batch.campaigns import Job
from commands.identify_batch.row import Row, failed_row

WORKER_CHECK_S = 1.0  # between two looks at whether the workers are still there


@dataclass(frozen=True)
class WorkerDied:
    """What comes back of a campaign whose worker was ended while it ran."""

    why: str


@dataclass(frozen=True)
class NotRun:
    """What comes back of a campaign that a worker could not even begin, and why."""

    why: str


Outcome = Row | WorkerDied | NotRun
Done = Callable[[], None]


class Pool(Protocol):
    """Workers that take campaigns."""

    def capacity(self) -> int:
        """Campaigns that can run at once, now."""

    def submit(self, job: Job, done: Done) -> Callable[[], Outcome]:
        """Start a campaign. ``done`` is called, from any thread, once what is returned may be asked for the outcome."""

    def check(self) -> None:
        """Raise where no outcome will ever come."""


def run_jobs(
    pool: Pool, jobs: Sequence[Job], attempts: int, version: str, finished: Callable[[Job, Row], None]
) -> None:
    """Run every job until it has a row, and hand each row over as it comes.

    No more is given out than runs at once, so that a worker that dies takes few with it. Which of them ended it cannot
    be told: each is run again when all others are done, alone, so that none is blamed for another. A job that has
    ended its worker ``attempts`` times is a failed row.
    """
    waiting, suspects = deque(jobs), deque[Job]()
    deaths: Counter[str] = Counter()
    running: dict[str, tuple[Job, Callable[[], Outcome]]] = {}
    ready: SimpleQueue[str] = SimpleQueue()

    def start(job: Job) -> None:
        running[job.path] = job, pool.submit(job, lambda: ready.put(job.path))

    while waiting or suspects or running:
        room = pool.capacity() - len(running) if waiting else 0
        for _ in range(min(room, len(waiting))):
            start(waiting.popleft())
        if suspects and not waiting and not running:
            start(suspects.popleft())
        try:
            path = ready.get(timeout=WORKER_CHECK_S)
        except Empty:
            pool.check()
            continue
        job, outcome_of = running.pop(path)
        outcome = outcome_of()
        if isinstance(outcome, WorkerDied):
            deaths[path] += 1
            if deaths[path] < attempts:
                suspects.append(job)
                continue
            outcome = NotRun(
                f"its worker was ended {attempts} time(s) while it ran ({outcome.why}). Usually it ran out of "
                "memory: identify it with identify-run, or cut the recording into shorter runs"
            )
        finished(job, failed_row(job, outcome.why, version, 0.0) if isinstance(outcome, NotRun) else outcome)
