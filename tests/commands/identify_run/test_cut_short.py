"""`identify-run` cut short by a fault, by Ctrl-C, by a lost terminal, by a full disk: what is kept and said."""

from __future__ import annotations

import errno
import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from commands.campaign.saving import save
from commands.identify_run.app import app
from commands.terminal.display import Terminal
from commands.terminal.exit_codes import TRACEBACK_FILE
from rig.errors import DeviceFault, RigError
from rig.recording.hdf5 import read_recording_h5
from tests.commands.identify_run.identifiers import Identifier
from tests.commands.support import SECOND_SET_S, command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig


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
    assert accepted.runs == [["5 Hz"]]
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
    assert f"No set was completed, so nothing was identified. The recording is in {tmp_path / 'out'}" in done.stderr


def test_where_a_fault_came_before_the_first_sample_nothing_is_said_to_be_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accepted: Identifier
) -> None:
    put_on_stage(monkeypatch, ScriptedRig(lambda now_s: (_ for _ in ()).throw(DeviceFault("dead"))))
    done = command(app, write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "What was recorded is" not in done.stderr
    assert (
        f"Nothing was recorded: the campaign ended before the first sample of a set. {tmp_path / 'out'} holds"
        in done.stderr
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
        self.on_loss("Stopped because the terminal was closed")

    monkeypatch.setattr(Terminal, "note", note_and_lose)
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), "--quiet", "--out", out).exit_code == 130
    result = json.loads((out / "result.json").read_text())
    assert result["aborted"] is True and "terminal was closed" in result["reasons"][0]


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
    assert {path.name for path in out.iterdir()} >= {"result.json", "model.yaml", "recording.h5"}
