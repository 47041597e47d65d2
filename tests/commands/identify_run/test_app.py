"""`identify-run`: the way from a configuration to a results folder and an exit code, the identifier stubbed."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from commands.campaign.saving import save
from commands.identify_run.app import app
from commands.terminal.display import Terminal
from commands.terminal.exit_codes import TRACEBACK_FILE
from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.errors import DeviceFault, RecordingError, RigError
from rig.platform import Platform
from rig.recording.hdf5 import read_recording_h5
from rig.recording.run import Recording, Run
from tests.commands.support import SECOND_SET_S, TWO_SETS, command, put_on_stage, write_config
from tests.identify.sample import sample
from tests.rig.scripted import ScriptedRig

TRUTH = """
simulated:
  platform:
    inertia_kg_m2: 0.02345678
    damping_nm_s_rad: 0.0456789
    stiffness_nm_rad: 678.9012
    effects: {coulomb_friction: {level_nm: 0.123456789}}
"""
TRUE_NUMBERS = {0.02345678, 0.0456789, 678.9012, 0.123456789}
ALL_FILES = {"result.json", "report.html", "model.yaml", "recording.h5"}


class Identifier:
    """Stands in for the loop: remembers what it was given and answers what a test wants."""

    def __init__(self, answer: Identification | BaseException) -> None:
        self.given: list[tuple[Recording, Platform, IdentifyConfig]] = []
        self._answer = answer

    def __call__(
        self,
        recording: Recording,
        declared: Platform,
        settings: IdentifyConfig,
        progress: Callable[[str], None] | None = None,
    ) -> Identification:
        self.given.append((recording, declared, settings))
        if progress is not None:
            progress("looking at the residual")
        if isinstance(self._answer, BaseException):
            raise self._answer
        return self._answer


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> Callable[[Identification | BaseException], Identifier]:
    def stub(answer: Identification | BaseException) -> Identifier:
        identifier = Identifier(answer)
        loop = ModuleType("identify.pipeline")
        loop.identify = identifier  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "identify.pipeline", loop)
        return identifier

    return stub


@pytest.fixture
def accepted(stubbed: Callable[[Identification], Identifier]) -> Identifier:
    return stubbed(sample(2.0)[0])


def write_recording(folder: Path) -> Path:
    rows = "\n".join(f"{i / 100},{i % 7 - 3},{(i % 5) / 10}" for i in range(400))
    (folder / "a.csv").write_text(f"time_s,torque_nm,rate_rad_s\n{rows}\n")
    return write_config(folder, "backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n")


def files_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_campaign_that_is_accepted_ends_in_0_with_all_results(tmp_path: Path, accepted: Identifier) -> None:
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 0, done.output
    assert files_in(out) >= ALL_FILES
    assert json.loads((out / "result.json").read_text())["accepted"] is True
    assert "Torque is SIMULATED" in done.stderr and "looking at the residual" in done.stderr
    assert "Coulomb friction is missing" in done.stdout and str(out) in done.stdout


def test_one_that_is_not_accepted_ends_in_1_with_all_results_and_the_reason(
    tmp_path: Path, stubbed: Callable[[Identification], Identifier]
) -> None:
    reason = "the residual stays unexplained: play a multisine"
    stubbed(dataclasses.replace(sample(2.0)[0], accepted=False, reasons=(reason,)))
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--quiet", "--out", out)
    assert done.exit_code == 1
    assert done.stdout == "" and reason in done.stderr
    assert files_in(out) >= ALL_FILES


def test_recordings_are_identified_without_anything_being_played(tmp_path: Path, accepted: Identifier) -> None:
    out = tmp_path / "out"
    done = command(app, write_recording(tmp_path), "--out", out)
    assert done.exit_code == 0, done.output
    assert "nothing moves" in done.stderr
    assert files_in(out) == ALL_FILES
    assert len(accepted.given[0][0].runs) == 1


def test_a_recording_that_the_identifier_refuses_ends_in_2_and_nothing_is_written(
    tmp_path: Path, stubbed: Callable[[BaseException], Identifier]
) -> None:
    stubbed(RecordingError("a.csv: constant torque with constant rate tells nothing: excite it"))
    out = tmp_path / "out"
    done = command(app, write_recording(tmp_path), "--out", out)
    assert done.exit_code == 2
    assert "excite it" in done.stderr
    assert not out.exists()


def test_the_identifier_gets_samples_and_the_declared_model_and_nothing_of_the_truth(
    tmp_path: Path, accepted: Identifier
) -> None:
    config = write_config(tmp_path, TWO_SETS.replace("simulated: {}\n", TRUTH))
    assert command(app, config, "--quiet", "--out", tmp_path / "out").exit_code == 0
    recording, declared, _ = accepted.given[0]
    assert declared == Platform()
    assert recording.info == {}
    assert {f.name for f in dataclasses.fields(recording)} == {"runs", "axis", "noise", "info"}
    assert TRUE_NUMBERS.isdisjoint(numbers_in(accepted.given[0]))
    # The folder keeps the whole configuration; only the identifier does not see it.
    assert "0.123456789" in read_recording_h5(tmp_path / "out" / "recording.h5").info["config_text"]


def numbers_in(thing: Any) -> set[float]:
    """All numbers in a value, samples of arrays left out: those are what was measured."""
    if isinstance(thing, float | int):
        return {float(thing)}
    if isinstance(thing, Run | Recording | Platform):
        return numbers_in(vars(thing))
    if isinstance(thing, IdentifyConfig):
        return numbers_in(thing.model_dump())
    if isinstance(thing, dict):
        return {n for value in thing.values() for n in numbers_in(value)}
    if isinstance(thing, list | tuple):
        return {n for value in thing for n in numbers_in(value)}
    return set()


def faulty_rig() -> ScriptedRig:
    def fault(now_s: float) -> None:
        if now_s >= SECOND_SET_S:
            raise DeviceFault("the drive fell silent")

    return ScriptedRig(fault)


def test_a_campaign_that_a_fault_cuts_short_is_identified_from_its_whole_sets_and_marked_aborted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    put_on_stage(monkeypatch, faulty_rig())
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 3
    assert [run.name for run in accepted.given[0][0].runs] == ["5 Hz"]
    assert json.loads((out / "result.json").read_text())["aborted"] is True
    assert len(read_recording_h5(out / "recording.h5").runs) == 2


@pytest.mark.parametrize("error", [RigError("too little to go by"), ZeroDivisionError("oh")])
def test_an_identification_that_fails_after_a_fault_does_not_hide_the_fault(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stubbed: Callable[[BaseException], Identifier],
    error: Exception,
) -> None:
    stubbed(error)
    put_on_stage(monkeypatch, faulty_rig())
    done = command(app, write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "the drive fell silent" in done.stderr and str(error) in done.stderr
    assert "Traceback" not in done.output


def test_without_one_whole_set_nothing_is_identified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    rig = ScriptedRig(lambda now_s: (_ for _ in ()).throw(DeviceFault("dead")) if now_s > 0.7 else None)
    put_on_stage(monkeypatch, rig)
    done = command(app, write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert accepted.given == []
    assert f"No set was complete, so nothing is identified. What was recorded is in {tmp_path / 'out'}" in done.stderr


def test_where_a_fault_came_before_the_first_sample_nothing_is_said_to_be_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    put_on_stage(monkeypatch, ScriptedRig(lambda now_s: (_ for _ in ()).throw(DeviceFault("dead"))))
    done = command(app, write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "What was recorded is" not in done.stderr
    assert (
        f"Nothing was recorded, since it ended before the first sample of a set; {tmp_path / 'out'} has" in done.stderr
    )


def test_a_fault_of_the_identifier_ends_in_70_with_the_recording_kept(
    tmp_path: Path, stubbed: Callable[[BaseException], Identifier]
) -> None:
    stubbed(ZeroDivisionError("so much for that"))
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 70
    assert "Traceback" not in done.output
    assert (out / TRACEBACK_FILE).exists()
    assert len(read_recording_h5(out / "recording.h5").runs) == 2


def test_ctrl_c_during_the_identification_ends_in_130_with_the_recording_kept(
    tmp_path: Path, stubbed: Callable[[BaseException], Identifier]
) -> None:
    stubbed(KeyboardInterrupt())
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), "--out", out).exit_code == 130
    assert len(read_recording_h5(out / "recording.h5").runs) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot signal itself gently there")
def test_ctrl_c_just_after_the_last_set_ends_in_130_and_marks_the_results_aborted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    put_on_stage(monkeypatch, ScriptedRig(on_disarm=lambda: os.kill(os.getpid(), signal.SIGINT)))
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 130
    assert "Stopped by Ctrl-C" in done.stderr
    assert json.loads((out / "result.json").read_text())["aborted"] is True
    assert len(read_recording_h5(out / "recording.h5").runs) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot signal itself gently there")
def test_ctrl_c_while_the_recording_is_saved_ends_in_130_with_results_marked_aborted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    def save_and_stop(*arguments: Any, **more: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return save(*arguments, **more)

    monkeypatch.setattr("commands.campaign.playing.save", save_and_stop)
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), "--out", out).exit_code == 130
    assert json.loads((out / "result.json").read_text())["aborted"] is True
    assert len(read_recording_h5(out / "recording.h5").runs) == 2


def test_a_terminal_lost_during_the_identification_ends_in_130_with_results_marked_aborted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    def note_and_lose(self: Terminal, text: str) -> None:
        self.on_loss("Stopped because its terminal is gone")

    monkeypatch.setattr(Terminal, "note", note_and_lose)
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), "--quiet", "--out", out).exit_code == 130
    result = json.loads((out / "result.json").read_text())
    assert result["aborted"] is True and "terminal is gone" in result["reasons"][0]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
def test_a_disk_that_does_not_take_the_report_ends_in_130_with_the_numbers_on_it_and_on_the_screen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier, code: int
) -> None:
    def full(*arguments: object) -> str:
        raise OSError(code, os.strerror(code), "report.html")

    monkeypatch.setattr("identify.report.files.report_html", full)
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--out", out)
    assert done.exit_code == 130
    assert os.strerror(code) in done.stderr
    assert "Coulomb friction is missing" in done.stdout and str(out) in done.stdout
    assert json.loads((out / "result.json").read_text())["accepted"] is True
    assert files_in(out) >= ALL_FILES - {"report.html"}


def test_a_dry_run_simulates_whatever_the_file_says(tmp_path: Path, accepted: Identifier) -> None:
    config = write_config(tmp_path, TWO_SETS.replace("backend: simulated", "backend: bench") + "bench: {}\n")
    done = command(app, config, "--dry-run", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "Torque is SIMULATED" in done.stderr


@pytest.mark.parametrize("arguments", [[], ["nowhere.yaml"], ["--frobnicate"]])
def test_bad_usage_ends_in_2_without_a_traceback(arguments: list[str]) -> None:
    done = command(app, *arguments)
    assert done.exit_code == 2
    assert "Traceback" not in done.output


def test_the_version_is_printed() -> None:
    done = command(app, "--version")
    assert (done.exit_code, done.stdout.split()[0]) == (0, "isp-rig")
