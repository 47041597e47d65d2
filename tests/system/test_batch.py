"""identify-batch as a program: workers and clients that are killed, a scheduler of somebody else, damaged files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pyarrow.parquet as pq
import pytest

from commands.identify_batch.app import app
from tests.commands.identify_batch.campaigns import play
from tests.commands.support import command

COMMAND = str(Path(sys.executable).parent / "identify-batch")
COUNT = 4
FAR_S = 120.0  # on a busy machine
BUSY_AGAIN_S = 1.0  # after a row a worker has its next campaign, which takes longer than this
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for seed in range(1, COUNT + 1):
        play(folder / f"c{seed}", seed)
    return folder


@pytest.fixture(scope="module")
def undisturbed(campaigns: Path) -> list[dict[str, object]]:
    """The rows that come out where nothing is killed."""
    table = campaigns.parent / f"{campaigns.name}.parquet"
    done = batch(f"{campaigns}/*", table, "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert "identified (" in done.stdout
    return rows_of(table)


def arguments(pattern: str, table: Path, *options: str) -> list[str]:
    return [COMMAND, pattern, "--out", str(table), *options]


def batch(pattern: str, table: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(arguments(pattern, table, *options), capture_output=True, text=True, check=False, timeout=600)


@contextmanager
def begun(pattern: str, table: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    client = subprocess.Popen(
        arguments(pattern, table, *options),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield client
    finally:
        client.kill()
        client.communicate()


def rows_of(table: Path) -> list[dict[str, object]]:
    """All of the table but the seconds."""
    rows: list[dict[str, object]] = pq.read_table(table).drop(["seconds"]).to_pylist()
    return rows


def journaled(table: Path) -> list[str]:
    """Paths of the rows that are kept so far."""
    journal = table.with_name(f"{table.name}.journal")
    lines = journal.read_bytes().splitlines(keepends=True)[1:] if journal.exists() else []
    return [json.loads(line)["path"] for line in lines if line.endswith(b"\n")]


def wait_for(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + FAR_S
    while not condition():
        assert time.monotonic() < until, "it has not come"
        time.sleep(0.05)


def workers_of(client: subprocess.Popen[str]) -> list[psutil.Process]:
    children = psutil.Process(client.pid).children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


@pytest.mark.slow
@posix
def test_a_worker_that_is_killed_in_the_middle_changes_nothing(
    campaigns: Path, undisturbed: list[dict[str, object]], tmp_path: Path
) -> None:
    table = tmp_path / "t.parquet"
    with begun(f"{campaigns}/*", table, "--workers", "2") as client:
        wait_for(lambda: len(journaled(table)) > 0)
        time.sleep(BUSY_AGAIN_S)
        workers_of(client)[0].send_signal(signal.SIGKILL)
        _, err = client.communicate(timeout=600)
    assert client.returncode == 0, err
    assert rows_of(table) == undisturbed
    assert "Traceback" not in err


@pytest.mark.slow
@posix
def test_a_campaign_whose_worker_is_killed_too_often_is_a_failed_row_and_the_others_go_on(
    campaigns: Path, undisturbed: list[dict[str, object]], tmp_path: Path
) -> None:
    table = tmp_path / "t.parquet"
    with begun(f"{campaigns}/*", table, "--workers", "2", "--attempts", "1") as client:
        wait_for(lambda: len(journaled(table)) > 0)
        time.sleep(BUSY_AGAIN_S)
        workers_of(client)[0].send_signal(signal.SIGKILL)
        _, err = client.communicate(timeout=600)
    assert client.returncode == 1, err
    rows = rows_of(table)
    (failed,) = [row for row in rows if row["status"] == "failed"]
    assert "its worker was ended 1 time(s) while it ran (its process was killed)" in str(failed["reason"])
    assert [row for row in rows if row is not failed] == [r for r in undisturbed if r["path"] != failed["path"]]


@pytest.mark.slow
@posix
def test_a_client_that_is_killed_loses_no_finished_campaign_and_leaves_no_worker(
    campaigns: Path, undisturbed: list[dict[str, object]], tmp_path: Path
) -> None:
    table = tmp_path / "t.parquet"
    with begun(f"{campaigns}/*", table, "--workers", "2") as client:
        wait_for(lambda: len(journaled(table)) > 0)
        workers = workers_of(client)
        client.send_signal(signal.SIGKILL)
        client.wait()
    kept = journaled(table)
    assert 0 < len(kept) < COUNT
    _, alive = psutil.wait_procs(workers, timeout=FAR_S)
    assert not alive
    assert not table.exists()
    done = batch(f"{campaigns}/*", table, "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert f"{len(kept)} of {COUNT} campaigns are in {table}.journal already" in done.stderr
    assert sorted(journaled(table)) == sorted({str(row["path"]) for row in undisturbed})  # each once
    assert rows_of(table) == undisturbed


@pytest.mark.slow
@posix
@pytest.mark.parametrize("when", ["starting", "identifying"])
def test_ctrl_c_ends_with_130_keeps_what_is_done_and_says_how_to_go_on(
    when: str, campaigns: Path, tmp_path: Path
) -> None:
    """As a terminal does it: the signal goes to the workers too."""
    table = tmp_path / "t.parquet"
    with begun(f"{campaigns}/*", table, "--workers", "2") as client:
        wait_for(lambda: bool(workers_of(client)) if when == "starting" else len(journaled(table)) > 0)
        workers = workers_of(client)
        os.killpg(client.pid, signal.SIGINT)
        out, err = client.communicate(timeout=FAR_S)
    assert client.returncode == 130, err
    assert out == ""
    assert f"of {COUNT} rows are kept in {table}.journal: run the same command to continue" in err
    assert "Stopped by Ctrl-C" in err
    assert "Traceback" not in err
    assert not psutil.wait_procs(workers, timeout=FAR_S)[1]


@contextmanager
def scheduler(folder: Path, workers: int) -> Iterator[str]:
    """A Dask scheduler and workers of somebody else; yields its address."""
    file = folder / "scheduler.json"
    starts = [[sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]]
    starts += [[sys.executable, "-m", "dask", "worker", "--nthreads", "1", "--no-dashboard"]] * workers
    started = []
    try:
        for start in starts:
            started.append(
                subprocess.Popen(
                    [*start, "--scheduler-file", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                    cwd=folder,
                )
            )  # fmt: skip
            wait_for(file.exists)
        yield json.loads(file.read_text(encoding="utf-8"))["address"]
    finally:
        for process in started[::-1]:
            for child in psutil.Process(process.pid).children(recursive=True):
                child.kill()
            process.kill()
            process.wait()


@pytest.mark.slow
def test_the_workers_of_a_scheduler_give_the_same_rows(
    campaigns: Path, undisturbed: list[dict[str, object]], tmp_path: Path
) -> None:
    table = tmp_path / "t.parquet"
    with scheduler(tmp_path, 2) as address:
        done = batch(f"{campaigns}/*", table, "--scheduler", address)
        assert done.returncode == 0, done.stderr
    assert f"by the workers at {address}" in done.stderr
    assert rows_of(table) == undisturbed


@pytest.mark.slow
def test_damaged_campaigns_are_rows_that_say_so_and_are_tried_again_on_request(
    campaigns: Path, undisturbed: list[dict[str, object]], tmp_path: Path
) -> None:
    table, runs = tmp_path / "t.parquet", tmp_path / "runs"
    for name, part in (("good", None), ("cut", 5000)):
        (runs / name).mkdir(parents=True)
        (runs / name / "recording.h5").write_bytes((campaigns / "c1" / "recording.h5").read_bytes()[:part])
    deadly = runs / "deadly"
    deadly.mkdir()
    (deadly / "own.py").write_text("import os\nos._exit(3)\n", encoding="utf-8")
    (deadly / "rig.yaml").write_text(
        "backend: recorded\nmodel: {effects_from: own.py}\nrecorded: {runs: [{file: ../good/recording.h5}]}\n",
        encoding="utf-8",
    )
    page, kept = tmp_path / "trend.html", tmp_path / "kept"
    options = ("--attempts", "2", "--trend", str(page), "--results", str(kept))
    done = batch(f"{runs}/*/r*.*", table, *options)
    assert done.returncode == 1, done.stderr
    cut, dead, good = rows_of(table)
    assert (cut["status"], dead["status"], good["status"]) == ("failed", "failed", "identified")
    assert "is damaged" in str(cut["reason"])
    assert "ended 2 time(s) while it ran" in str(dead["reason"])
    same = ("inertia_value", "inertia_std_error", "effect_parameters_json", "holdout_rate_rms_after")
    assert [good[name] for name in same] == [undisturbed[0][name] for name in same]
    assert "failed: " in done.stderr and "3/3 done, 2 failed" in done.stderr
    assert "Not identified" in page.read_text(encoding="utf-8")
    assert [p.name for p in kept.iterdir()] == [Path(str(good["results"])).name]
    assert (kept / Path(str(good["results"])).name / "report.html").exists()

    again = batch(f"{runs}/*/r*.*", table, *options)
    assert again.returncode == 1
    assert "3 of 3 campaigns are in" in again.stderr
    (runs / "cut" / "recording.h5").write_bytes((campaigns / "c2" / "recording.h5").read_bytes())  # a changed one
    (deadly / "own.py").unlink()
    (deadly / "rig.yaml").unlink()
    mended = batch(f"{runs}/*/r*.*", table, *options)
    assert mended.returncode == 0, mended.stderr
    assert "1 of 2 campaigns are in" in mended.stderr
    assert [row["status"] for row in rows_of(table)] == ["identified", "identified"]


@pytest.mark.slow
def test_what_failed_is_left_until_it_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "recording.h5").write_bytes(b"no recording")
    table, counts = tmp_path / "t.parquet", []
    for options in ((), (), ("--retry-failed",)):
        done = batch(f"{tmp_path}/*.h5", table, "--workers", "1", *options)
        assert done.returncode == 1
        counts.append(len(journaled(table)))
    assert counts == [1, 1, 2]


def test_wrong_usage_ends_with_2_and_writes_nothing(tmp_path: Path) -> None:
    (tmp_path / "recording.h5").write_bytes(b"no recording")
    (tmp_path / "other.parquet").write_bytes(b"of somebody else")
    for pattern, table, options, words in (
        ("nothing/*", "t.parquet", (), "matches no recorded campaign"),
        ("*.h5", "other.parquet", (), "exists without its journal"),
        ("*.h5", "t.parquet", ("--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), "exclude each other"),
        ("*.h5", "t.parquet", ("--workers", "0"), "--workers"),
    ):
        done = command(app, f"{tmp_path}/{pattern}", "--out", tmp_path / table, *options)
        assert done.exit_code == 2, done.output
        assert words in done.stderr
        assert "Traceback" not in done.stderr
    ended = batch(f"{tmp_path}/*.h5", tmp_path / "other.parquet")  # the program itself, once
    assert ended.returncode == 2 and "exists without its journal" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other.parquet", "recording.h5"]


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_said_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "recording.h5").write_bytes(b"no recording")
    done = batch(f"{tmp_path}/*.h5", tmp_path / "t.parquet", "--scheduler", "tcp://127.0.0.1:1")
    assert done.returncode == 2, done.stderr
    assert "no Dask scheduler answers there" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_the_extra_the_line_that_installs_it_is_said(tmp_path: Path) -> None:
    code = "import sys; sys.modules['distributed'] = None; from commands.identify_batch import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "x*", "--out", str(tmp_path / "t.parquet")],
        capture_output=True, text=True, check=False, env={**os.environ, "NO_COLOR": "1"},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == (
        "Error: identify-batch needs the package distributed, which is not installed: pip install 'isp-rig[batch]'\n"
    )
