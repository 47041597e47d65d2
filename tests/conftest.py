"""What every test starts from."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

# A test runner that was itself started in the background, or under nohup, hands down ignored signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
for _name in ("SIGHUP", "SIGTERM"):
    if hasattr(signal, _name):
        signal.signal(getattr(signal, _name), signal.SIG_DFL)

# Tests with deadlines of their own, by the beginning of their path: beside another one they would be late.
WITH_DEADLINES = (
    "drivers/amplifiers",
    "drivers/test_",
    "rig/cli",
    "rig/recording/test_flushing",
    "rig/recording/test_journal",
    "rig/recording/test_memory",
    "rig/test_re",
    "sim_backend/emulators",
    "system/test_bench",
    "system/test_commands",
    "system/test_full_disk",
    "system/test_safety",
)
HERE = Path(__file__).parent


def _has_deadlines(path: Path) -> bool:
    return path.relative_to(HERE).as_posix().startswith(WITH_DEADLINES)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Those that want the machine to themselves come last: every change from one kind to the other is a wait."""
    items.sort(key=lambda item: _has_deadlines(item.path))


@pytest.fixture(autouse=True)
def _machine_to_itself(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Where several workers run tests, one with deadlines waits for the others' to end, and they wait for it."""
    if sys.platform == "win32" or "PYTEST_XDIST_WORKER" not in os.environ:
        yield
        return
    import fcntl  # noqa: PLC0415 (there is none on Windows)

    alone = _has_deadlines(request.path)
    shared = tmp_path_factory.getbasetemp().parent
    with (shared / "queue.lock").open("w") as queue, (shared / "machine.lock").open("w") as machine:
        fcntl.flock(queue, fcntl.LOCK_EX)  # who waits for the machine is not passed by
        fcntl.flock(machine, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        yield
