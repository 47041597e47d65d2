"""`identify-run` on the emulated bench: stopped while it identifies, and replayed from its raw capture."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
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
# Short, and patient with a machine that others use: what is asserted is never how fast it was.
SHORT = (
    "excitation.sets=[{torque_nm: 40, frequency_hz: 3, duration_s: 1.5}, "
    "{torque_nm: 20, frequency_hz: 6, duration_s: 1.5}]",
    "excitation.rest_s=0.5", "bench.settle_s=2", "limits.missed_ticks=200", "limits.stale_gyro_ms=500",
    "limits.rate_deg_s=1000", "bench.amplifier.settings.drive_heartbeat_ms=1000",
    "identify.candidates=[coulomb_friction]", "identify.genetic.generations=5",
)  # fmt: skip
PLAYED_WITHOUT_A_STALL = 4  # attempts: a stall of 50 ms is rightly a trip, and not what is looked at here


def identify_run(log: Path, out: Path, *more: str) -> subprocess.Popen[bytes]:
    line = [*IDENTIFY_RUN, str(BENCH), "--out", str(out), *more]
    for override in SHORT:
        line += ["--set", override]
    with log.open("wb") as stream:
        return subprocess.Popen(line, stdout=stream, stderr=stream, stdin=subprocess.DEVNULL)


def played(tmp_path: Path, then: Callable[[subprocess.Popen[bytes], Path], int]) -> tuple[int, Path, str]:
    """Play on emulated devices until nothing stalls; the exit code, the results and what was said."""
    for attempt in range(PLAYED_WITHOUT_A_STALL):
        log, out = tmp_path / f"{attempt}.log", tmp_path / f"live{attempt}"
        code = then(identify_run(log, out, "--emulate"), log)
        said = log.read_text()
        if "stall or clock jump" not in said:
            break
    return code, out, said


def timeless(value: Any) -> Any:
    """A result without what tells when and where it was made."""
    if isinstance(value, dict):
        return {k: timeless(v) for k, v in value.items() if not k.endswith(("_utc", "_s")) and k != "provenance"}
    return [timeless(v) for v in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_a_raw_capture_replays_to_the_same_samples_and_the_same_result(tmp_path: Path) -> None:
    code, live, said = played(tmp_path, lambda process, _: process.wait(120))
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
    code, live, said = played(tmp_path, lambda process, _: process.wait(120))
    assert code in (0, 1), said
    other = ("--set", f"bench.replay={live}", "--set", "limits.travel_deg=2")
    assert identify_run(tmp_path / "other.log", tmp_path / "other", *other).wait(60) == 2
    assert "holds another campaign" in (tmp_path / "other.log").read_text()


@pytest.mark.slow
def test_ctrl_c_while_it_identifies_keeps_the_record_and_says_so(tmp_path: Path) -> None:
    def stop_when_fitting(process: subprocess.Popen[bytes], log: Path) -> int:
        while process.poll() is None and b"fitting the declared model" not in log.read_bytes():
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        return process.wait(60)

    code, out, said = played(tmp_path, stop_when_fitting)
    assert code == 130, said
    assert "Traceback" not in said
    recording = read_recording_h5(out / "recording.h5")
    assert len(recording.runs) == 2
    assert recording.info["emulated_drive"][-1]["torque_nm"][1] == 0.0


@pytest.mark.slow
def test_a_second_ctrl_c_leaves_no_torque_either(tmp_path: Path) -> None:
    """In one process, on a stage: test_play.py and test_stop_requests.py. One Ctrl-C on the bench: test_commands.py."""

    def stop_twice(process: subprocess.Popen[bytes], log: Path) -> int:
        journal = log.with_name(f"live{log.stem}") / "recording.journal"
        while process.poll() is None and not (journal.exists() and journal.stat().st_size > 20_000):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        return process.wait(60)

    code, out, said = played(tmp_path, stop_twice)
    assert code == 130, said
    assert "Traceback" not in said
    assert (out / "raw" / "wire.cap").stat().st_size > 0
