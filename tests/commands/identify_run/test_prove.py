"""`identify.prove`: when a campaign goes on with its proof, and what stands when it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from commands.identify_run.app import app
from tests.commands.identification.proofs import AUTO, PROOF, SETS, SPRUNG, names, result, right, wrong
from tests.commands.identify_run.identifiers import stand_in
from tests.commands.support import command, write_config


def test_by_default_no_proof_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, right())
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path, SPRUNG), "--out", out).exit_code == 0
    assert names(out) == SETS and result(out)["proof"] is None


def test_auto_plays_it_into_the_same_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    identifier = stand_in(monkeypatch, right())
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path, SPRUNG), *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    assert names(out) == SETS + PROOF and len(identifier.given) == 1
    assert result(out)["proof"]["status"] == "confirmed"
    assert "The compensated model: confirmed." in done.stdout


def test_a_refuted_name_makes_room_for_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    identifier = stand_in(monkeypatch, wrong(), right())
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path, SPRUNG), *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    assert identifier.runs == [SETS, SETS + PROOF]
    assert result(out)["verdict"]["effects"] == ["cubic_stiffness"]


def test_asked_for_without_a_terminal_it_is_not_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, right())
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path, SPRUNG), "--set", "identify.prove=ask", "--yes", "--out", out)
    assert done.exit_code == 0, done.output
    assert names(out) == SETS and "rig prove DIR" in done.stderr


@pytest.mark.parametrize(("answer", "runs"), [("yes", 6), ("no", 2)])
def test_at_a_terminal_the_question_decides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str, runs: int
) -> None:
    stand_in(monkeypatch, right())
    monkeypatch.setattr("commands.identify_run.prove.on_terminal", lambda: True)
    monkeypatch.setattr("commands.campaign.playing._ask", lambda question: answer)
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path, SPRUNG), "--set", "identify.prove=ask", "--out", out)
    assert done.exit_code == 0, done.output
    assert len(names(out)) == runs
