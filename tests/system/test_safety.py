"""Whatever fails, torque goes to zero and the data stays: each fault of the table, done to processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

if sys.platform == "win32":
    pytest.skip("emulated devices need pseudo terminals", allow_module_level=True)

from benchmarks.fault_cases import CASES
from benchmarks.faults import undisturbed
from benchmarks.kills import one_kill
from sim_backend.emulators.faults.kinds import FAULTS


@pytest.mark.slow
@pytest.mark.parametrize("name", [case.name for case in CASES])
def test_a_fault_ends_in_zero_torque_in_time_with_its_exit_code_and_its_record(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(request.config.rootpath)
    case = next(case for case in CASES if case.name == name)
    outcome = undisturbed(case, 1.3, tmp_path / "run")
    assert outcome.wrong == ()


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [-1.0, 0.3, 1.2, 2.4, 3.3])
def test_a_host_that_is_killed_leaves_a_drive_without_torque_and_its_record(
    after_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(request.config.rootpath)
    kill = one_kill(after_s, tmp_path / "run")
    assert kill.wrong == ""
    assert not kill.lost_s > 0.100


def test_every_fault_of_the_emulators_stands_in_the_table() -> None:
    named = {word for case in CASES for word in case.name.split()}
    # Two of them can be seen before the first set only, and stand there under what they are to the operator.
    assert set(FAULTS) - named == {"gyro_scaled"}
    assert len(CASES) >= 40


@pytest.mark.slow
def test_emulators_end_when_nobody_listens_any_more(request: pytest.FixtureRequest) -> None:
    line = (sys.executable, "-c", "from commands.rig import main; main()", "emulate", "examples/bench.yaml")
    process = subprocess.Popen(
        line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=request.config.rootpath
    )
    assert process.stdin is not None and process.stdout is not None
    assert b"listening" in process.stdout.readline()
    process.stdout.close()
    try:
        assert process.wait(10.0) == 0
    finally:
        process.kill()
        process.wait()
        process.stdin.close()
