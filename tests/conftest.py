"""What every test starts from."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Generator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

# A test runner that was itself started in the background, or under nohup, hands down ignored signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
for _name in ("SIGHUP", "SIGTERM"):
    if hasattr(signal, _name):
        signal.signal(getattr(signal, _name), signal.SIG_DFL)

# A worker has one processor: threads of the linear algebra would only wait for each other. Before numpy is imported.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Programs that tests start would each compile some two hundred modules that were compiled before. What Numba compiles
# is kept beside the source whatever this says.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Tests with deadlines of their own, by the beginning of their path: two of them at once would be late.
WITH_DEADLINES = (
    "drivers/amplifiers",
    "drivers/bench",
    "drivers/capture",
    "drivers/gyroscopes/test_gyro_line",
    "drivers/replay",
    "drivers/test_",
    "drivers/timing",
    "drivers/transport",
    "commands/campaign",
    "commands/rig",
    "commands/terminal",
    "rig/config/test_malformed",
    "rig/recording/test_flushing",
    "rig/recording/test_journal",
    "rig/recording/test_memory",
    "rig/recording/test_readers",
    "rig/recording/test_tail_file",
    "rig/sequencer/test_warm_up",
    "rig/test_realtime",
    "sim_backend/emulators",
    "system/test_bench",
    "system/test_commands",
    "system/test_full_disk",
    "system/test_live_view",
    "system/test_report_browser",
    "system/test_safety",
)
# The files that take longest: begun late, one worker would wait for the other.
LONGEST = (
    "identify/rivals/test_tone_origin",
    "identify/rivals/test_filtered_noise",
    "identify/test_pipeline",
    "identify/runs/test_measured_channels",
    "system/test_identify_campaigns",
    "system/test_real_recordings",
    "system/test_from_python",
    "system/test_effect_of_your_own",
)
# Files that compile the same plant: on two workers each would compile it for itself the first time.
COMPILED_TOGETHER = ("tests/benchmarks/test_blind", "tests/benchmarks/test_field")
HERE = Path(__file__).parent


def pytest_sessionstart(session: pytest.Session) -> None:
    """In a fresh clone: compile before workers start, each of which would do it for itself."""
    starts_workers = session.config.getoption("numprocesses", None) and "PYTEST_XDIST_WORKER" not in os.environ
    if starts_workers and not any((HERE.parent / "rig/dynamics/__pycache__").glob("riccati.riccati-*.nbi")):
        subprocess.run([sys.executable, "-m", "tests.compile_ahead"], cwd=HERE.parent, check=True)


def _has_deadlines(path: Path) -> bool:
    return _is_of(path, WITH_DEADLINES)


@cache  # asked for every test, of which a file has many
def _is_of(path: Path, beginnings: tuple[str, ...]) -> bool:
    return path.is_relative_to(HERE) and path.relative_to(HERE).as_posix().startswith(beginnings)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Tests without deadlines give way: where workers outnumber processors, those with deadlines are on time."""
    if "PYTEST_XDIST_WORKER" in os.environ and not _has_deadlines(item.path) and hasattr(os, "nice"):
        _give_way()


@cache
def _give_way() -> None:
    os.nice(10)  # once a worker: it has no more deadlines after this


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Hundreds of modules and thousands of tests stay: no search for garbage goes through them, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Those with deadlines come first: one worker takes them all. Then the longest."""
    items.sort(key=lambda item: (not _has_deadlines(item.path), not _is_of(item.path, LONGEST)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """One worker runs all tests with deadlines, one after the other; the others take the rest, file by file.

    By file, so that what a module computes once is computed once.
    """
    from xdist.scheduler import LoadScopeScheduling  # noqa: PLC0415 (tests run without it, too)

    class Lanes(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            if _has_deadlines(config.rootpath / file):
                return "with deadlines"
            return next((shared for shared in COMPILED_TOGETHER if file.startswith(shared)), file)

    config.option.loadscopereorder = False  # in the order of the collection, not by number of tests
    return Lanes(config, log)
