"""Whatever a command raises ends in one message, one exit code, and no traceback on the terminal."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from commands.terminal.exit_codes import TRACEBACK_FILE, run_to_exit_code
from rig.errors import (
    Aborted,
    ConfigError,
    DeviceFault,
    PreflightRefusal,
    RecordingError,
    RigError,
    SafetyTrip,
    UsageError,
)

CODES = {
    ConfigError: 2,
    RecordingError: 2,
    PreflightRefusal: 2,
    DeviceFault: 3,
    SafetyTrip: 4,
    RigError: 70,
    Aborted: 130,
    KeyboardInterrupt: 130,
    ZeroDivisionError: 70,
    MemoryError: 70,
}


def raising(error: BaseException) -> int:
    raise error


@pytest.mark.parametrize("kind", CODES, ids=lambda kind: kind.__name__)
def test_every_kind_of_error_has_its_exit_code_and_its_message(
    kind: type[BaseException], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_to_exit_code(lambda: raising(kind("the gyro is upside down"))) == CODES[kind]
    said = capsys.readouterr().err
    assert "the gyro is upside down" in said
    assert "Traceback" not in said


def test_a_command_that_ends_well_keeps_its_code() -> None:
    assert run_to_exit_code(lambda: 1) == 1


def test_the_traceback_of_a_fault_of_the_program_goes_to_the_results_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_to_exit_code(lambda: 1 // 0, lambda: tmp_path)
    kept = (tmp_path / TRACEBACK_FILE).read_text()
    assert "ZeroDivisionError" in kept and "Traceback" in kept
    said = capsys.readouterr().err
    assert str(tmp_path / TRACEBACK_FILE) in said and "Traceback" not in said


def test_an_expected_error_leaves_no_traceback_file(tmp_path: Path) -> None:
    run_to_exit_code(lambda: raising(SafetyTrip("travel")), lambda: tmp_path)
    assert not (tmp_path / TRACEBACK_FILE).exists()


def test_a_full_disk_ends_as_ctrl_c_does(capsys: pytest.CaptureFixture[str]) -> None:
    full = OSError(errno.ENOSPC, "No space left on device", "runs/a/result.json")
    assert run_to_exit_code(lambda: raising(full)) == 130
    assert "runs/a/result.json" in capsys.readouterr().err


@pytest.mark.parametrize("quoted", ["x" * 100_000, "word " * 20_000])
def test_a_long_quote_is_cut_and_both_its_ends_stay(capsys: pytest.CaptureFixture[str], quoted: str) -> None:
    text = f"begin {quoted} end.yaml:3\nthe cure"
    assert run_to_exit_code(lambda: raising(UsageError(text))) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("Error: begin ") and first.endswith("end.yaml:3") and "characters) ..." in first
    assert len(first) <= 2100 and second == "the cure"


def test_a_name_of_two_hundred_characters_is_told_whole(capsys: pytest.CaptureFixture[str]) -> None:
    name = "/a" * 100
    run_to_exit_code(lambda: raising(UsageError(f"there is no file {name}")))
    assert capsys.readouterr().err == f"Error: there is no file {name}\n"


def test_what_breaks_of_being_stopped_halfway_is_the_stop_and_not_a_fault_of_the_program(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_to_exit_code(lambda: 1 // 0, lambda: tmp_path, lambda: "Stopped by Ctrl-C") == 130
    said = capsys.readouterr().err
    assert said == "Stopped by Ctrl-C.\n"
    assert "ZeroDivisionError" in (tmp_path / TRACEBACK_FILE).read_text()
    assert run_to_exit_code(lambda: raising(SafetyTrip("travel")), lambda: tmp_path, lambda: "Stopped by Ctrl-C") == 4
