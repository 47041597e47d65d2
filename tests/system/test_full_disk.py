"""A disk that is really full, in the middle of a set: torque goes off, the data stays, and it can be got back."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("a small disk is made by mounting one", allow_module_level=True)

from benchmarks.emulated import OFF, SHORT, Devices, Host, recovered
from drivers.capture.wire_capture import TICK, read_capture
from rig.recording.hdf5 import read_recording_h5
from rig.recording.journal_reader import read_journal

SIZE_MIB = 2  # full a second or two into the set
RIG = (sys.executable, "-c", "from commands.rig import main; main()")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "disk"
    folder.mkdir()
    line = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MIB}m", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(line, capture_output=True, check=False).returncode:
        pytest.skip("nothing may be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)


@pytest.mark.slow
def test_a_disk_that_fills_up_in_a_set_takes_the_torque_off_and_keeps_what_was_written(
    small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(request.config.rootpath)
    folder = small_disk / "run"
    with Devices(SHORT) as devices:
        host = Host(devices, folder, SHORT, log=tmp_path / "said.txt")
        code = host.ended(60.0)
        time.sleep(0.4)  # until the drive's own watchdog would have had its time
        off = [event for event in devices.events if event["event"] in OFF]
        last = [event for event in devices.events if "torque_nm" in event][-1]
    assert code == 130
    assert "No space left on device" in host.said and "free space" in host.said
    assert "Traceback" not in host.said
    assert last["torque_nm"][1] == 0.0
    assert not any(event["event"] == "watchdog" for event in off)  # the host took it off, not its silence
    assert not host.left_over()
    found = recovered(folder)
    assert found.problem == "" and found.last_sample_s is not None and found.verdict_s is None
    captured_s = [entry.time_s for entry in read_capture(folder / "raw" / "wire.cap") if entry.kind == TICK]
    off_s = min(event["time_s"] for event in off if event["time_s"] > captured_s[0] + 1.0)
    assert off_s - max(found.last_sample_s, captured_s[-1]) < 0.1
    samples = len(read_journal(folder / "recording.journal").runs[0].tables["samples"])
    assert samples > 100

    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)  # room is made
    subprocess.run([*RIG, "recover", str(folder)], check=True, capture_output=True)
    export = next(path for path in (folder / "recovered.h5", folder / "recording.h5") if path.exists())
    assert len(read_recording_h5(export).runs[0].time_s) == samples
