"""`identify-run` on the emulated bench: stopped while it identifies, and replayed from its raw capture.

In step, for what is asserted is not how fast it was; in real time: test_bench.py, test_commands.py and test_safety.py.
"""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from commands.rig.recover import recover_folder
from rig.recording.hdf5 import read_recording_h5

ROOT = Path(__file__).parents[2]
BENCH = ROOT / "examples" / "bench.yaml"
IDENTIFY_RUN = (sys.executable, "-c", "from commands.identify_run import main; main()")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="emulated devices need pseudo terminals")
SHORT = (
    "excitation.sets=[{torque_nm: 40, frequency_hz: 3, duration_s: 1.5}, "
    "{torque_nm: 20, frequency_hz: 6, duration_s: 1.5}]",
    "excitation.rest_s=0.5", "bench.settle_s=2", "bench.emulator.clock=in_step", "limits.rate_deg_s=1000",
    "identify.candidates=[coulomb_friction]", "identify.genetic.generations=5",
)  # fmt: skip


def identify_run(log: Path, out: Path, *more: str) -> subprocess.Popen[bytes]:
    line = [*IDENTIFY_RUN, str(BENCH), "--out", str(out), *more]
    for override in SHORT:
        line += ["--set", override]
    with log.open("wb") as stream:
        return subprocess.Popen(line, stdout=stream, stderr=stream, stdin=subprocess.DEVNULL)


def emulated(tmp_path: Path) -> tuple[subprocess.Popen[bytes], Path, Path]:
    """A campaign that begins to play on emulated devices; what it says, and its results folder."""
    log, out = tmp_path / "live.log", tmp_path / "live"
    return identify_run(log, out, "--emulate"), log, out


def played(tmp_path: Path) -> tuple[int, Path, str]:
    """One that is played and identified; the exit code, the results and what was said."""
    process, log, out = emulated(tmp_path)
    return process.wait(120), out, log.read_text()


def timeless(value: Any) -> Any:
    """A result without what tells when and where it was made."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if not k.endswith(("_utc", "_s")) and k != "provenance"}
    return [timeless(v) for v in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_a_raw_capture_replays_to_the_same_samples_and_the_same_result(tmp_path: Path) -> None:
    code, live, said = played(tmp_path)
    assert "in step with the bench" in said
    assert code in (0, 1), said
    again = tmp_path / "again"
    assert identify_run(tmp_path / "again.log", again, "--set", f"bench.replay={live}").wait(120) == code
    heard = (tmp_path / "again.log").read_text()
    assert "Torque is SIMULATED: replay of" in heard
    one, other = read_recording_h5(live / "recording.h5"), read_recording_h5(again / "recording.h5")
    assert len(one.runs) == len(other.runs) == 2
    for a, b in zip(one.runs, other.runs, strict=True):
        for name in ("time_s", "rate_rad_s", "valid", "torque_time_s", "torque_nm"):
            assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True), name
    results = [json.loads((folder / "result.json").read_text()) for folder in (live, again)]
    assert timeless(results[0]) == timeless(results[1])
    assert results[0]["before"]["parameters"]
    shutil.copytree(live / "raw", tmp_path / "alone" / "raw")
    assert recover_folder(tmp_path / "alone") == 0
    recalled = read_recording_h5(tmp_path / "alone" / "recording.h5")
    for a, b in zip(one.runs, recalled.runs, strict=True):
        for name in ("time_s", "rate_rad_s", "valid", "torque_time_s", "torque_nm"):
            whole, longer = getattr(a, name), getattr(b, name)  # up to the mark behind the tail of the set
            assert np.array_equal(whole, longer[: len(whole)], equal_nan=True), name


@pytest.mark.slow
def test_a_capture_of_another_campaign_is_refused(tmp_path: Path) -> None:
    code, live, said = played(tmp_path)
    assert code in (0, 1), said
    other = ("--set", f"bench.replay={live}", "--set", "limits.travel_deg=2")
    assert identify_run(tmp_path / "other.log", tmp_path / "other", *other).wait(60) == 2
    assert "holds another campaign" in (tmp_path / "other.log").read_text()


@pytest.mark.slow
def test_ctrl_c_while_it_identifies_keeps_the_record_and_says_so(tmp_path: Path) -> None:
    process, log, out = emulated(tmp_path)
    while process.poll() is None and b"fitting the declared model" not in log.read_bytes():
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    code, said = process.wait(60), log.read_text()
    assert code == 130, said
    assert "Traceback" not in said
    recording = read_recording_h5(out / "recording.h5")
    assert len(recording.runs) == 2
    assert recording.info["emulated_drive"][-1]["torque_nm"][1] == 0.0


@pytest.mark.slow
def test_a_second_ctrl_c_leaves_no_torque_either(tmp_path: Path) -> None:
    """In one process, on a stage: test_play.py and test_stop_requests.py. One Ctrl-C on the bench: test_commands.py."""
    process, log, out = emulated(tmp_path)
    journal = out / "recording.journal"
    while process.poll() is None and not (journal.exists() and journal.stat().st_size > 20_000):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGINT)
    code, said = process.wait(60), log.read_text()
    assert code == 130, said
    assert "Traceback" not in said
    assert (out / "raw" / "wire.cap").stat().st_size > 0
