"""The command line, with workers that answer at once: which campaigns are identified again, and the exit codes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from typer.testing import Result

from commands.identify_batch import app as batch
from commands.identify_batch.campaigns import Job
from commands.identify_batch.dispatch import Done, Outcome
from commands.identify_batch.row import COLUMNS, IDENTIFIED, failed_row
from commands.terminal.version import version
from tests.commands.support import command


class AtOnce:
    """A campaign whose file holds "bad" fails, any other one is identified."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def capacity(self) -> int:
        return 2

    def submit(self, job: Job, done: Done) -> Callable[[], Outcome]:
        self.asked.append(Path(job.file).parent.name)
        done()
        return lambda: self.row(job)

    def row(self, job: Job) -> Outcome:
        if "bad" in Path(job.file).read_text(encoding="utf-8"):
            return failed_row(job, "it is bad", version(), 1.0)
        if job.results is not None:
            Path(job.results).mkdir(parents=True)
        return dict.fromkeys(COLUMNS) | {
            "path": job.path, "content_sha256": job.content, "status": IDENTIFIED, "accepted": True, "rig": "a",
            "name": Path(job.file).parent.name, "axis": "rotary", "effects": [], "results": job.results, "seconds": 1.0,
        }  # fmt: skip

    def check(self) -> None:
        raise AssertionError("every campaign answers at once")


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> AtOnce:
    pool = AtOnce()

    @contextmanager
    def stand_in(*_: object) -> Iterator[AtOnce]:
        yield pool

    monkeypatch.setattr(batch, "_pool", stand_in)
    return pool


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    for name, text in (("a", "good"), ("b", "bad"), ("c", "good")):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "recording.h5").write_text(text, encoding="utf-8")
    return tmp_path / "runs"


def run(runs: Path, *options: object) -> Result:
    return command(batch.app, f"{runs}/*", "--out", runs.parent / "t.parquet", *options)


def test_a_failed_campaign_makes_exit_code_1_and_the_table_holds_all(runs: Path, workers: AtOnce) -> None:
    done = run(runs)
    assert done.exit_code == 1
    assert done.stdout == f"{runs.parent / 't.parquet'}: 3 campaigns, 2 identified (2 accepted), 1 failed\n"
    assert "it is bad" in done.stderr
    assert pq.read_table(runs.parent / "t.parquet")["status"].to_pylist() == ["identified", "failed", "identified"]


def test_a_second_run_makes_only_what_has_changed_or_is_asked_for(runs: Path, workers: AtOnce) -> None:
    run(runs)
    assert run(runs).exit_code == 1
    assert workers.asked == ["a", "b", "c"]
    run(runs, "--retry-failed")
    assert workers.asked[3:] == ["b"]
    (runs / "b" / "recording.h5").write_text("mended", encoding="utf-8")
    assert run(runs).exit_code == 0
    assert workers.asked[4:] == ["b"]
    run(runs, "--seed", "3")
    assert workers.asked[5:] == ["a", "b", "c"]


def test_rows_that_another_pattern_leaves_out_are_used_again(runs: Path, workers: AtOnce) -> None:
    run(runs)
    done = command(batch.app, f"{runs}/a", "--out", runs.parent / "t.parquet")
    assert done.exit_code == 0
    assert pq.read_table(runs.parent / "t.parquet").num_rows == 1
    run(runs)
    assert workers.asked == ["a", "b", "c"]
    assert pq.read_table(runs.parent / "t.parquet").num_rows == 3


def test_results_that_are_asked_for_later_or_were_deleted_are_made(runs: Path, workers: AtOnce) -> None:
    run(runs)
    kept = runs.parent / "kept"
    run(runs, "--results", kept)
    assert workers.asked[3:] == ["a", "c"]
    assert len(list(kept.iterdir())) == 2
    next(kept.glob("c-*")).rmdir()
    run(runs, "--results", kept)
    assert workers.asked[5:] == ["c"]


def test_the_page_of_trends_has_the_rigs_and_what_failed(runs: Path, workers: AtOnce) -> None:
    run(runs, "--trend", runs.parent / "pages" / "trend.html", "--quiet")
    page = (runs.parent / "pages" / "trend.html").read_text(encoding="utf-8")
    assert "<h2>a</h2>" in page and "it is bad" in page


def test_a_full_disk_ends_with_130_and_says_that_rows_are_kept(
    runs: Path, workers: AtOnce, monkeypatch: pytest.MonkeyPatch
) -> None:
    from commands.identify_batch import journal  # noqa: PLC0415 (to take its sync away)

    calls = []

    def full(_: int) -> None:
        calls.append(1)
        if len(calls) > 2:  # the head and the first row
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal.os, "fsync", full)
    done = run(runs)
    assert done.exit_code == 130
    assert "No space left on device" in done.stderr
    assert "1 of 3 rows are kept" in done.stderr
