"""Campaigns given to workers that die: which are run again, when, and which are given up."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from commands.identify_batch import dispatch
from commands.identify_batch.campaigns import Job
from commands.identify_batch.dispatch import Done, NotRun, Outcome, WorkerDied, run_jobs
from commands.identify_batch.row import COLUMNS, FAILED, IDENTIFIED, Row


class ScriptedPool:
    """Each campaign answers with its script, one outcome an attempt, then with a row.

    As with real workers a campaign that ends its worker may take others with it: ``taken_along``.
    """

    def __init__(self, slots: int, scripts: dict[str, list[Outcome]] | None = None) -> None:
        self.slots, self.scripts = slots, scripts or {}
        self.running: list[str] = []
        self.beside: list[tuple[str, ...]] = []  # what ran when each was begun
        self.order: list[str] = []
        self.checks = 0

    def capacity(self) -> int:
        return self.slots

    def submit(self, job: Job, done: Done) -> Callable[[], Outcome]:
        self.beside.append(tuple(self.running))
        self.running.append(job.path)
        self.order.append(job.path)
        done()

        def outcome() -> Outcome:
            self.running.remove(job.path)
            script = self.scripts.get(job.path)
            return script.pop(0) if script else row_of(job)

        return outcome

    def check(self) -> None:
        self.checks += 1
        raise RuntimeError("no outcome will come")


def row_of(job: Job) -> Row:
    return dict.fromkeys(COLUMNS) | {"path": job.path, "status": IDENTIFIED}


def jobs(names: str) -> list[Job]:
    return [Job(name, f"/{name}", (), "content") for name in names]


def run(pool: ScriptedPool, names: str, attempts: int = 3) -> dict[str, Row]:
    rows: dict[str, Row] = {}

    def finished(job: Job, row: Row) -> None:
        assert job.path not in rows
        rows[job.path] = row

    run_jobs(pool, jobs(names), attempts, "1", finished)
    return rows


def statuses(rows: dict[str, Row]) -> dict[str, str]:
    return {path: row["status"] for path, row in rows.items()}


def test_no_more_is_given_out_than_runs_at_once() -> None:
    pool = ScriptedPool(2)
    assert statuses(run(pool, "abcde")) == dict.fromkeys("abcde", IDENTIFIED)
    assert max(len(beside) for beside in pool.beside) == 1


def test_a_campaign_whose_worker_died_is_run_again_alone_when_the_others_are_done() -> None:
    pool = ScriptedPool(3, {"b": [WorkerDied("killed")]})
    assert statuses(run(pool, "abcde")) == dict.fromkeys("abcde", IDENTIFIED)
    assert pool.order[-1] == "b"
    assert pool.beside[-1] == ()


@pytest.mark.parametrize("attempts", [1, 2, 4])
def test_one_that_keeps_ending_its_worker_is_given_up_after_that_many(attempts: int) -> None:
    pool = ScriptedPool(2, {"b": [WorkerDied("its process was killed")] * 9})
    rows = run(pool, "abc", attempts)
    assert statuses(rows) == {"a": IDENTIFIED, "b": FAILED, "c": IDENTIFIED}
    assert pool.order.count("b") == attempts
    assert f"ended {attempts} time(s) while it ran (its process was killed)" in rows["b"]["reason"]


def test_two_that_die_together_are_not_blamed_for_each_other() -> None:
    pool = ScriptedPool(2, {"a": [WorkerDied("killed")] * 9, "b": [WorkerDied("killed")]})
    assert statuses(run(pool, "ab")) == {"a": FAILED, "b": IDENTIFIED}


def test_one_that_no_worker_could_begin_is_failed_at_once_with_the_reason() -> None:
    pool = ScriptedPool(1, {"a": [NotRun("the worker could not run it: ImportError: x")]})
    rows = run(pool, "ab")
    assert rows["a"]["reason"] == "the worker could not run it: ImportError: x"
    assert pool.order == ["a", "b"]


@pytest.mark.parametrize("names", [["a"], ["a", "b"]])
def test_where_there_is_no_worker_the_pool_is_asked_what_to_do(
    names: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dispatch, "WORKER_CHECK_S", 0.01)
    pool = ScriptedPool(0)
    with pytest.raises(RuntimeError, match="no outcome"):
        run(pool, "".join(names))
    assert pool.checks == 1 and pool.order == []
