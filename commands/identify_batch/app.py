"""The command `identify-batch`: many recorded campaigns, one row each."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from commands.terminal.exit_codes import run_to_exit_code
from commands.terminal.options import Overrides, Quiet, Version, new_app
from commands.terminal.stop_requests import StopRequests

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from commands.identify_batch.campaigns import Job
    from commands.identify_batch.cluster import DaskPool
    from commands.identify_batch.journal import RowJournal
    from commands.identify_batch.row import Row
    from commands.terminal.display import Terminal

MAX_OTHERS_NAMED = 3
app = new_app("")

Pattern = Annotated[
    str, typer.Argument(metavar="GLOB", help="In quotation marks: recording.h5 of results folders, or rig.yaml files.")
]
Table = Annotated[
    Path, typer.Option("--out", metavar="TABLE.parquet", help="The table to write; a second run continues it.")
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers", metavar="N", min=1, max=1024, help="Worker processes on this machine. Default: one per core."
    ),
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="tcp://HOST:PORT", help="Use the workers of this Dask scheduler instead.")
]
Results = Annotated[Path | None, typer.Option(metavar="DIR", help="Keep a results folder of each campaign in DIR.")]
Trend = Annotated[Path | None, typer.Option(metavar="FILE.html", help="Also write a page of trends, rig by rig.")]
Attempts = Annotated[
    int, typer.Option(metavar="N", min=1, max=100, help="Workers that a campaign may end before it counts as failed.")
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Identify again the campaigns that failed in an earlier run.")
]
BatchSeed = Annotated[int | None, typer.Option("--seed", metavar="N", min=0, max=2**32 - 1, help="Seed of the search.")]


@dataclass(frozen=True)
class Options:
    """What was asked for on the command line."""

    pattern: str
    out: Path
    workers: int | None
    scheduler: str | None
    results: Path | None
    trend: Path | None
    attempts: int
    retry_failed: bool
    overrides: tuple[str, ...]
    quiet: bool


@app.command()
def identify_batch(
    pattern: Pattern,
    out: Table,
    workers: Workers = None,
    scheduler: Scheduler = None,
    results: Results = None,
    trend: Trend = None,
    attempts: Attempts = 3,
    retry_failed: RetryFailed = False,
    overrides: Overrides = None,
    seed: BatchSeed = None,
    quiet: Quiet = False,
    version: Version = False,
) -> None:
    """Identify all recorded campaigns that GLOB matches, one row of a Parquet table each.

    A run that was stopped or killed goes on where it stood. Exit codes: 0 all identified, accepted or not, 1 some
    failed (the table says why), 2 wrong usage, 70 internal error, 130 Ctrl-C.
    """
    seeds = () if seed is None else (f"identify.seed={seed}",)
    given = (*(overrides or ()), *seeds)
    options = Options(pattern, out, workers, scheduler, results, trend, attempts, retry_failed, given, quiet)
    raise typer.Exit(run_batch(options))


def run_batch(options: Options) -> int:
    """Run with signals heeded; returns the exit code. Never raises."""
    stops = StopRequests()

    def work() -> int:
        from commands.terminal.display import Terminal

        with stops.handling_signals():
            terminal = Terminal(sys.stderr, options.quiet)
            stops.show, terminal.on_loss = terminal.show, stops.request
            with terminal.writing():
                return _run(options, terminal, stops)

    return run_to_exit_code(work, stopped=lambda: stops.reason)


def _run(options: Options, terminal: Terminal, stops: StopRequests) -> int:
    from commands.identify_batch.campaigns import campaigns_of
    from commands.identify_batch.cluster import require_batch
    from commands.identify_batch.journal import RowJournal, journal_path
    from commands.terminal.display import plain

    _refuse_usage(options)
    require_batch()
    paths, others = campaigns_of(options.pattern)
    if others:
        named = ", ".join(plain(path) for path in others[:MAX_OTHERS_NAMED])
        more = ", ..." if len(others) > MAX_OTHERS_NAMED else ""
        terminal.show(f"{len(others)} match(es) are not recorded campaigns and are skipped: {named}{more}")
    with RowJournal(journal_path(options.out)) as journal:
        terminal.note(f"reading {len(paths)} recorded campaign(s)")
        jobs = _jobs(options, paths)
        missing = [job for job in jobs if not _stands(journal.rows.get(job.path), job, options.retry_failed)]
        if len(missing) < len(jobs):
            terminal.show(f"{len(jobs) - len(missing)} of {len(jobs)} campaigns are in {journal.path} already")
        try:
            _identify(options, jobs, missing, journal, terminal, stops)
        except BaseException:
            kept = sum(job.path in journal.rows for job in jobs)
            terminal.show_always(
                f"{kept} of {len(jobs)} rows are kept in {journal.path}: run the same command to continue"
            )
            raise
        rows = [journal.rows[job.path] for job in jobs]
    return _conclude(options, rows, terminal, stops)


def _refuse_usage(options: Options) -> None:
    """Raise UsageError for options that exclude each other, and for a table that would overwrite something else."""
    from commands.identify_batch.journal import journal_path
    from rig.errors import UsageError

    if options.scheduler is not None and options.workers is not None:
        raise UsageError("--workers and --scheduler exclude each other: the scheduler has workers. Leave one out.")
    if options.out.exists() and not journal_path(options.out).exists():
        raise UsageError(
            f"--out {options.out} exists without its journal ({journal_path(options.out).name}), so it cannot be "
            "continued: choose another name, or move it away"
        )


def _jobs(options: Options, paths: list[str]) -> list[Job]:
    from commands.identify_batch.campaigns import Job, content_of
    from commands.terminal.version import version

    jobs = []
    for path in paths:
        file = Path(path).absolute()
        content = content_of(file, options.overrides, version())
        kept = None
        if options.results is not None:  # a changed campaign gets a new folder, and the old one stays
            name = file.parent.name if file.suffix.lower() == ".h5" else file.stem
            kept = str(options.results.absolute() / f"{name}-{_short(path)}-{content[:8]}")
        jobs.append(Job(path, str(file), options.overrides, content, kept))
    return jobs


def _short(path: str) -> str:
    """Tells campaigns of one name apart."""
    import hashlib

    return hashlib.sha256(path.encode(errors="surrogateescape")).hexdigest()[:8]


def _stands(row: Row | None, job: Job, retry_failed: bool) -> bool:
    """Whether an earlier row is the one that would come out again."""
    from commands.identify_batch.row import FAILED

    if row is None or row["content_sha256"] != job.content:
        return False
    if row["status"] == FAILED:
        return not retry_failed
    return job.results is None or (row["results"] == job.results and Path(job.results).is_dir())


def _identify(
    options: Options, jobs: list[Job], missing: list[Job], journal: RowJournal, terminal: Terminal, stops: StopRequests
) -> None:
    from commands.identify_batch.dispatch import run_jobs
    from commands.identify_batch.progress import Progress
    from commands.identify_batch.row import FAILED
    from commands.terminal.version import version

    if not missing:
        return
    standing = {job.path for job in jobs} - {job.path for job in missing}
    failed = sum(journal.rows[path]["status"] == FAILED for path in standing)
    progress = Progress(terminal, len(jobs), len(standing), failed)

    def finished(job: Job, row: Row) -> None:
        with stops.saving():
            journal.append(row)
        progress.finished(row)

    with _pool(options, len(missing), terminal) as pool:
        run_jobs(pool, missing, options.attempts, version(), finished)


def _pool(options: Options, campaigns: int, terminal: Terminal) -> AbstractContextManager[DaskPool]:
    from commands.identify_batch.cluster import cores, local_workers, scheduler_workers

    if options.scheduler is not None:
        terminal.show(f"{campaigns} campaign(s) to identify, by the workers at {options.scheduler}")
        return scheduler_workers(options.scheduler, terminal.show)
    count = min(options.workers or cores(), campaigns)
    terminal.show(f"{campaigns} campaign(s) to identify, by {count} worker process(es)")
    return local_workers(count, terminal.show)


def _conclude(options: Options, rows: list[Row], terminal: Terminal, stops: StopRequests) -> int:
    from commands.identify_batch.row import FAILED
    from commands.identify_batch.table import write_table
    from commands.terminal.exit_codes import OK

    with stops.saving():
        write_table(options.out, rows)
        if options.trend is not None:
            from commands.identify_batch.trends import write_trends

            write_trends(options.trend, rows)
    failed = sum(row["status"] == FAILED for row in rows)
    accepted = sum(bool(row["accepted"]) for row in rows)
    terminal.flush()
    if not options.quiet:
        identified = f"{len(rows) - failed} identified ({accepted} accepted), {failed} failed"
        sys.stdout.write(f"{options.out}: {len(rows)} campaigns, {identified}\n")
    return 1 if failed else OK
