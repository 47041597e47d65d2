"""A follow-up at the command line: who is asked, what is played, what is kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from commands.identify_run.app import app
from commands.rig.app import app as rig_app
from rig.interface import Statement, Torque
from rig.recording.hdf5 import read_recording_h5
from tests.commands.identify_run.follow_ups import AUTO, Stub, doubtful, names, plan_of, result, sure
from tests.commands.support import TWO_SETS, command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig


def test_where_the_file_says_auto_it_is_played_and_everything_is_identified_again(tmp_path: Path, stub: Stub) -> None:
    identifier, out = stub(doubtful(), sure()), tmp_path / "out"
    done = command(app, write_config(tmp_path), *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    assert identifier.runs == [
        ["5 Hz", "7 Hz"], ["5 Hz", "7 Hz", "follow-up: 11 Hz"]
    ]  # fmt: skip
    assert done.stderr.count("Torque is SIMULATED") == 2  # pre-flight and statement anew
    assert "A sine parts Coulomb friction from Stribeck friction" in done.stderr
    follow_up = result(out)["follow_up"]
    assert follow_up["played"] is True
    assert follow_up["separated"] == [{"effect": "coulomb_friction", "rival": "stribeck_friction"}]
    assert set(follow_up["error"]) == {"before", "after", "after_follow_up"}
    assert "without follow-up" in done.stdout and "can be distinguished now" in done.stdout
    assert "without follow-up" in (out / "report.html").read_text(encoding="utf-8")


def test_the_recording_of_both_parts_is_kept_in_one_file_and_in_its_journals(tmp_path: Path, stub: Stub) -> None:
    stub(doubtful(), sure())
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), *AUTO, "--quiet", "--out", out).exit_code == 0
    recording = read_recording_h5(out / "recording.h5")
    assert [run.name for run in recording.runs] == ["5 Hz", "7 Hz", "follow-up: 11 Hz"]
    assert recording.info["follow_ups"][0]["sets"][0]["complete"] is True
    assert (out / "recording.journal").exists() and (out / "follow_up.journal").exists()
    assert (out / "follow_up.yaml").exists()
    assert not list(out.glob("*.new")) and not list(out.glob("*.part"))


def test_the_simulated_gyro_does_not_repeat_its_noise(tmp_path: Path, stub: Stub) -> None:
    again = replace(plan_of(), excitation={**plan_of().excitation, "sets": [
        {"kind": "sine", "torque_nm": 20.0, "frequency_hz": 5.0, "duration_s": 0.4, "name": "follow-up: 5 Hz"}
    ]})  # fmt: skip
    stub(doubtful(), sure(), plans=(again,))
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), *AUTO, "--quiet", "--out", out).exit_code == 0
    first, _, new = (run.rate_rad_s for run in read_recording_h5(out / "recording.h5").runs)
    assert first is not None and new is not None
    assert 0.0 < abs(first - new).max() < 0.02  # the same motion, read with other noise


def test_asked_for_without_a_terminal_it_is_written_and_not_played(tmp_path: Path, stub: Stub) -> None:
    identifier, out = stub(doubtful()), tmp_path / "out"
    done = command(app, write_config(tmp_path), "--yes", "--out", out)
    assert done.exit_code == 0, done.output
    assert len(identifier.given) == 1 and names(out) == ["5 Hz", "7 Hz"]
    follow_up = result(out)["follow_up"]
    assert follow_up["played"] is False and "asked on a terminal only" in follow_up["note"]
    assert "asked on a terminal only" in " ".join(done.stdout.split())
    assert (out / "follow_up.yaml").exists()


def test_never_means_never(tmp_path: Path, stub: Stub) -> None:
    identifier, out = stub(doubtful()), tmp_path / "out"
    done = command(app, write_config(tmp_path), "--set", "identify.follow_up=never", "--yes", "--out", out)
    assert done.exit_code == 0
    assert len(identifier.given) == 1
    assert "is never" in result(out)["follow_up"]["note"]


@pytest.mark.parametrize(("answer", "runs"), [("yes", 3), ("no", 2), ("", 2)])
def test_at_a_terminal_the_question_decides(
    tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch, answer: str, runs: int
) -> None:
    stub(doubtful(), sure())
    monkeypatch.setattr("commands.campaign.follow_up.on_terminal", lambda: True)
    monkeypatch.setattr("commands.campaign.playing._ask", lambda question: answer)
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), "--yes", "--out", out)
    assert done.exit_code == 0, done.output
    assert len(names(out)) == runs


class RealRig(ScriptedRig):
    """Says that its torque is real."""

    def statement(self) -> Statement:
        return Statement(Torque.REAL, ("a scripted rig",))


@pytest.mark.parametrize(("options", "runs"), [(("--yes",), 2), ((*AUTO, "--yes"), 3)])
def test_yes_answers_for_real_torque_only_where_the_file_says_auto(
    tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], runs: int
) -> None:
    stub(doubtful(), sure())
    put_on_stage(monkeypatch, RealRig())
    out = tmp_path / "out"
    done = command(app, write_config(tmp_path), *options, "--out", out)
    assert done.exit_code == 0, done.output
    assert len(names(out)) == runs


def test_without_yes_real_torque_is_asked_for_each_time(
    tmp_path: Path, stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub(doubtful(), sure())
    put_on_stage(monkeypatch, RealRig())
    asked: list[str] = []

    def consent(statement: Statement, yes: bool, is_terminal: bool, ask: Callable[[str], str]) -> None:
        asked.append(f"{statement.torque.value}, yes {yes}")

    monkeypatch.setattr("commands.campaign.consent.ask_consent", consent)
    monkeypatch.setattr("commands.campaign.follow_up.on_terminal", lambda: True)
    out = tmp_path / "out"
    assert command(app, write_config(tmp_path), "--yes", "--out", out).exit_code == 0
    assert asked == ["REAL, yes False"]  # --yes is no answer where the file says ask


@pytest.mark.parametrize(("second", "runs"), [(5000.0, 4), (100.0, 3)])
def test_a_second_one_is_played_only_where_it_promises_more_and_never_a_third(
    tmp_path: Path, stub: Stub, second: float, runs: int
) -> None:
    plans = (plan_of(), plan_of(2, second), plan_of(3, 1e6))
    identifier, out = stub(doubtful(), plans=plans), tmp_path / "out"
    done = command(app, write_config(tmp_path), *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    assert len(names(out)) == runs and len(identifier.given) == runs - 1
    assert result(out)["follow_up"]["separated"] == []
    assert "still cannot be distinguished" in done.stdout


def test_recordings_of_ones_own_get_the_file(tmp_path: Path, stub: Stub) -> None:
    stub(doubtful())
    rows = "\n".join(f"{i / 100},{i % 7 - 3},{(i % 5) / 10}" for i in range(400))
    (tmp_path / "a.csv").write_text(f"time_s,torque_nm,rate_rad_s\n{rows}\n")
    config = write_config(tmp_path, "backend: recorded\nrecorded: {runs: [{file: a.csv}]}\n")
    out = tmp_path / "out"
    done = command(app, config, *AUTO, "--out", out)
    assert done.exit_code == 0, done.output
    played = write_config(tmp_path, TWO_SETS.split("excitation:")[0] + f"excitation: {out / 'follow_up.yaml'}\n")
    done = command(rig_app, "play", played, "--quiet", "--out", tmp_path / "again")
    assert done.exit_code == 0, done.output
    assert names(tmp_path / "again") == ["follow-up: 11 Hz"]
