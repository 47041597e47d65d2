"""`rig play`: whatever ends a campaign, torque goes off, the recording stays, and the exit code says which it was."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from commands.campaign.campaign_part import PlayedCampaign
from commands.campaign.saving import describe_location
from commands.rig.app import app
from commands.terminal.exit_codes import TRACEBACK_FILE
from rig.errors import DeviceFault
from rig.interface import Exchange, ExpectedDelay, GyroSample, Statement, Torque, TorqueSample
from rig.recording.hdf5 import read_recording_h5
from rig.recording.journal import Journal, JournalError
from rig.recording.run import Recording
from tests.commands.support import SECOND_SET_S, TWO_SETS, command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig

posix = pytest.mark.skipif(sys.platform == "win32", reason="a process cannot signal itself gently there")


class RealRig(ScriptedRig):
    """Says that its torque is real."""

    def statement(self) -> Statement:
        return Statement(Torque.REAL, ("a scripted rig",))


def after(at_s: float, happens: Callable[[float], Exchange | None]) -> Callable[[float], Exchange | None]:
    return lambda now_s: happens(now_s) if now_s >= at_s else None


def breaking(error: BaseException) -> Callable[[float], Exchange | None]:
    def happens(now_s: float) -> Exchange | None:
        raise error

    return happens


def run_names(out: Path) -> list[str]:
    return [run.name for run in read_recording_h5(out / "recording.h5").runs]


def test_a_simulated_campaign_is_recorded_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = command(app, "play", write_config(tmp_path), "--out", out)
    assert done.exit_code == 0, done.output
    assert "Torque is SIMULATED" in done.stderr
    assert "2 complete sets" in done.stdout
    recording = read_recording_h5(out / "recording.h5")
    assert [r.name for r in recording.runs] == ["5 Hz", "7 Hz"]
    assert recording.info["config_text"] == TWO_SETS
    assert recording.info["sets"][0]["complete"] and recording.info["aborted"] is None
    assert (out / "recording.journal").exists()


def test_the_same_seed_gives_the_same_noise_and_another_one_does_not(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        assert command(app, "play", config, "--quiet", "--seed", seed, "--out", tmp_path / name).exit_code == 0
    a, b, c = (read_recording_h5(tmp_path / n / "recording.h5").runs[0].rate_rad_s for n in "abc")
    assert a is not None and b is not None and c is not None
    assert np.array_equal(a, b) and not np.array_equal(a, c)


def test_quiet_is_silent_where_all_is_well(tmp_path: Path) -> None:
    done = command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")


def test_an_existing_folder_is_never_overwritten(tmp_path: Path) -> None:
    done = command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path)
    assert done.exit_code == 2
    assert "never overwritten" in done.stderr


def test_a_refused_campaign_leaves_no_folder_behind(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = command(app, "play", write_config(tmp_path), "--set", "limits.torque_nm=10", "--out", out)
    assert done.exit_code == 2
    assert "At most 10.00 N m is allowed" in done.stderr
    assert not out.exists()


def test_real_torque_without_a_terminal_is_refused_and_with_yes_is_played_loudly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = RealRig()
    put_on_stage(monkeypatch, rig)
    config, out = write_config(tmp_path), tmp_path / "out"
    refused = command(app, "play", config, "--out", out)
    assert (refused.exit_code, rig.log, out.exists()) == (2, [], False)
    done = command(app, "play", config, "--yes", "--quiet", "--out", out)
    assert done.exit_code == 0, done.output
    assert "Torque is REAL" in done.stderr  # even if quiet


def test_a_device_fault_ends_in_3_with_the_whole_set_and_the_part_of_the_next_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = ScriptedRig(after(SECOND_SET_S, breaking(DeviceFault("the drive fell silent"))))
    put_on_stage(monkeypatch, rig)
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "Device fault: the drive fell silent" in done.stderr and "CUT SHORT" in done.stderr
    assert rig.torque_nm == 0.0 and rig.log[-2:] == ["disarm", "close"]
    assert run_names(tmp_path / "out") == ["5 Hz", "7 Hz"]
    info = read_recording_h5(tmp_path / "out" / "recording.h5").info
    assert [s["complete"] for s in info["sets"]] == [True, False]
    assert "fell silent" in info["aborted"]


def test_what_the_drivers_expect_of_the_delay_goes_into_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Expecting(ScriptedRig):
        @property
        def expected_delay(self) -> ExpectedDelay:
            return ExpectedDelay(1e-4, ("gyro group delay 2.2 ms",))

    put_on_stage(monkeypatch, Expecting())
    assert command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out").exit_code == 0
    told = read_recording_h5(tmp_path / "out" / "recording.h5").info["expected_torque_delay"]
    assert told == {"delay_s": 1e-4, "corrections": ["gyro group delay 2.2 ms"]}


def test_a_fault_before_the_first_sample_says_that_nothing_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_stage(monkeypatch, ScriptedRig(after(0.0, breaking(DeviceFault("the drive fell silent")))))
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "Nothing was recorded" in done.stdout and "the recording is in" not in done.stdout
    assert not (tmp_path / "out" / "recording.h5").exists()


def test_where_the_journal_cannot_be_read_back_nobody_claims_that_it_is_empty(tmp_path: Path) -> None:
    told = describe_location(PlayedCampaign(Recording(()), frozenset(), None, read_back=False), tmp_path)
    assert "could not be read back" in told and "rig recover" in told


def test_a_trip_ends_in_4_and_names_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def too_fast(now_s: float) -> Exchange:
        return Exchange((GyroSample(now_s, 9.0, True),), (TorqueSample(now_s, 1.0),))

    put_on_stage(monkeypatch, ScriptedRig(after(SECOND_SET_S, too_fast)))
    done = command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 4
    assert "Safety trip: Torque is off. Tripped on rate (limits.rate_deg_s)" in done.stderr
    assert run_names(tmp_path / "out") == ["5 Hz", "7 Hz"]


@posix
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_just_after_the_last_set_ends_in_130_with_everything_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    rig = ScriptedRig(on_disarm=lambda: os.kill(os.getpid(), getattr(signal, name)))
    put_on_stage(monkeypatch, rig)
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 130
    assert "Stopped by" in done.stderr and "2 complete sets" in done.stdout
    assert run_names(tmp_path / "out") == ["5 Hz", "7 Hz"]
    assert "Stopped by" in read_recording_h5(tmp_path / "out" / "recording.h5").info["aborted"]


@posix
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_in_130_with_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    sent: list[float] = []

    def signal_once(now_s: float) -> None:
        if not sent:
            sent.append(now_s)
            os.kill(os.getpid(), getattr(signal, name))

    rig = ScriptedRig(after(SECOND_SET_S, signal_once))
    put_on_stage(monkeypatch, rig)
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 130
    assert "Stopped" in done.stderr
    assert rig.torque_nm == 0.0 and rig.log[-2:] == ["disarm", "close"]
    assert run_names(tmp_path / "out") == ["5 Hz", "7 Hz"]


@posix
def test_a_second_ctrl_c_takes_the_torque_off_from_within_the_handler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def twice(now_s: float) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

    rig = ScriptedRig(after(SECOND_SET_S, twice))
    put_on_stage(monkeypatch, rig)
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 130
    assert "torque off" in rig.log and rig.log[-2:] == ["disarm", "close"]
    assert run_names(tmp_path / "out") == ["5 Hz", "7 Hz"]


def test_a_fault_of_the_program_keeps_the_samples_and_its_traceback_off_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = ScriptedRig(after(SECOND_SET_S, breaking(ZeroDivisionError("so much for that"))))
    put_on_stage(monkeypatch, rig)
    out = tmp_path / "out"
    done = command(app, "play", write_config(tmp_path), "--out", out)
    assert done.exit_code == 70
    assert rig.torque_nm == 0.0
    assert "so much for that" in done.stderr and "Traceback" not in done.output
    assert "ZeroDivisionError" in (out / TRACEBACK_FILE).read_text()
    assert run_names(out) == ["5 Hz", "7 Hz"]


def test_a_disk_that_fills_up_ends_in_130_with_the_torque_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    append, calls = Journal.append, []

    def filling(journal: Journal, kind: str, rows: object) -> None:
        calls.append(kind)
        if len(calls) > 60:
            raise JournalError("cannot write: No space left on device")
        append(journal, kind, rows)  # type: ignore[arg-type]

    monkeypatch.setattr(Journal, "append", filling)
    rig = ScriptedRig()
    put_on_stage(monkeypatch, rig)
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out")
    assert done.exit_code == 130
    assert "No space left" in done.stderr
    assert rig.torque_nm == 0.0 and rig.log[-1] == "close"


def test_a_bench_without_a_port_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    text = TWO_SETS.replace("backend: simulated", "backend: bench") + "bench: {}\n"
    done = command(app, "play", write_config(tmp_path, text), "--yes", "--out", out)
    assert done.exit_code == 2
    assert "bench.gyroscope.port: is empty" in done.stderr
    assert "bench.amplifier.can.channel: is empty" in done.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--dry-run", "--emulate"], "exclude each other"),
        (["--emulate"], "the file has no `bench:` section"),
        (["--seed", "-1"], "--seed"),
        (["--set", "limits.travel=1"], "did you mean 'travel_deg'"),
    ],
)
def test_options_that_make_no_sense_are_refused(tmp_path: Path, options: list[str], said: str) -> None:
    done = command(app, "play", write_config(tmp_path), "--out", tmp_path / "out", *options)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.split())


def test_recordings_cannot_be_played_but_their_campaign_can_be_simulated(tmp_path: Path) -> None:
    text = TWO_SETS.replace("backend: simulated", "backend: recorded") + "recorded: {runs: [{file: a.csv}]}\n"
    config = write_config(tmp_path, text)
    refused = command(app, "play", config, "--out", tmp_path / "out")
    assert refused.exit_code == 2 and "plays nothing" in refused.stderr
    assert command(app, "play", config, "--dry-run", "--out", tmp_path / "out").exit_code == 0


def test_a_refusal_says_where_the_limit_stands(tmp_path: Path) -> None:
    text = TWO_SETS.replace("simulated: {}", "simulated: {gyro: {full_scale_deg_s: 10}}")
    path, out = write_config(tmp_path, text), tmp_path / "out"
    refused = command(app, "play", path, "--out", out)
    assert refused.exit_code == 2
    assert f"{path}:3: simulated.gyro.full_scale_deg_s is 10" in refused.stderr
    stricter = command(app, "play", path, "--out", out, "--set", "limits.rate_deg_s=5")
    assert "--set limits.rate_deg_s=5: limits.rate_deg_s is 5" in stricter.stderr
