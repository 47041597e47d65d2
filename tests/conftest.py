"""What every test starts from."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

# A test runner that was itself started in the background, or under nohup, hands down ignored signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
for _name in ("SIGHUP", "SIGTERM"):
    if hasattr(signal, _name):
        signal.signal(getattr(signal, _name), signal.SIG_DFL)

# A worker has one processor: threads of the linear algebra would only wait for each other. Before numpy is imported.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Tests with deadlines of their own, by the beginning of their path: beside another one they would be late.
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
    "system/test_report_browser",
    "system/test_safety",
)
# So long that whoever comes last waits for them.
LONGEST = ("system/test_identify_campaigns", "system/test_real_recordings")
HERE = Path(__file__).parent


def _has_deadlines(path: Path) -> bool:
    return _is_of(path, WITH_DEADLINES)


def _is_of(path: Path, beginnings: tuple[str, ...]) -> bool:
    return path.is_relative_to(HERE) and path.relative_to(HERE).as_posix().startswith(beginnings)


def _locks(controller: int) -> Path:
    return Path(tempfile.gettempdir()) / f"isp-rig-tests-{controller}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest come first, and those that want the machine to themselves last: every change is a wait."""
    items.sort(key=lambda item: (_has_deadlines(item.path), not _is_of(item.path, LONGEST)))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Where several workers run tests, one with deadlines waits for the others' to end, and they wait for it.

    From before the first fixture of a module is made to after the last one is gone.
    """
    if sys.platform == "win32" or "PYTEST_XDIST_WORKER" not in os.environ:
        return (yield)
    import fcntl  # noqa: PLC0415 (there is none on Windows)

    shared = _locks(os.getppid())
    shared.mkdir(exist_ok=True)
    with (shared / "queue").open("w") as queue, (shared / "machine").open("w") as machine:
        fcntl.flock(queue, fcntl.LOCK_EX)  # who waits for the machine is not passed by
        fcntl.flock(machine, fcntl.LOCK_EX if _has_deadlines(item.path) else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        try:
            return (yield)
        finally:
            fcntl.flock(machine, fcntl.LOCK_UN)  # a process that a test has left must not keep it


def pytest_sessionfinish() -> None:
    """The one that started the workers takes the locks away."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        shutil.rmtree(_locks(os.getpid()), ignore_errors=True)
