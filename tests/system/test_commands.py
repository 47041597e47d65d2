"""The commands as processes of their own: what they print, what they leave behind, how they end."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rig.recording.hdf5 import read_recording_h5

ROOT = Path(__file__).parents[2]
RIG = (sys.executable, "-c", "from commands.rig import main; main()")
IDENTIFY_RUN = (sys.executable, "-c", "from commands.identify_run import main; main()")
posix = pytest.mark.skipif(sys.platform == "win32", reason="emulated devices need pseudo terminals")
# Patient with a machine that others use: how far it may be late is asked in the tests of the guard.
ONE_LONG_SET = (
    "--set", "excitation.sets=[{torque_nm: 60, frequency_hz: 3, duration_s: 60}]",
    "--set", "limits.missed_ticks=200", "--set", "limits.stale_gyro_ms=500",
    "--set", "bench.amplifier.settings.drive_heartbeat_ms=1000",
)  # fmt: skip
SAFETY_TRIP = 4


def start(*arguments: object) -> subprocess.Popen[str]:
    line = [str(a) for a in arguments]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)


def in_time(happened: Callable[[], bool], process: subprocess.Popen[str], limit_s: float = 60.0) -> bool:
    """Whether it happens before the process ends."""
    deadline_s = time.monotonic() + limit_s
    while not happened():
        if process.poll() is not None:
            return False
        assert time.monotonic() < deadline_s, "it never happened"
        time.sleep(0.02)
    return True


def size_of(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


@posix
def test_ctrl_c_on_the_bench_takes_the_torque_off_disables_the_drive_and_keeps_the_record(tmp_path: Path) -> None:
    for attempt in range(3):  # a machine that others use may stall, and a stall before the set is rightly a trip
        out = tmp_path / str(attempt)
        process = start(*RIG, "play", ROOT / "examples" / "bench.yaml", "--emulate", "--out", out, *ONE_LONG_SET)
        if in_time(lambda file=out / "recording.journal": size_of(file) > 100_000, process):
            break
        said = process.communicate()[1]
        late = "stall or clock jump" in said or "This computer is too slow" in said
        assert process.returncode == SAFETY_TRIP and late, said
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130, said
    assert "Stopped by Ctrl-C: torque is off" in said and "Traceback" not in said
    recording = read_recording_h5(out / "recording.h5")
    assert 0.5 < recording.runs[0].duration_s < 59.0
    # Of the drive: the emulators also tell where the machine kept them from running.
    events = [e for e in recording.info["emulated_drive"] if e["event"] != "paused"]
    assert {e["event"] for e in events[-2:]} == {"disabled", "torque_zero"}
    assert events[-1]["torque_nm"][1] == 0.0
    assert recording.info["sets"][0]["complete"] is False


@posix
def test_emulate_says_where_it_listens_and_ends_with_ctrl_c() -> None:
    process = start(*RIG, "emulate", ROOT / "examples" / "bench.yaml")
    assert process.stdout is not None
    first = json.loads(process.stdout.readline())
    assert first["event"] == "listening"
    assert Path(first["gyro"]).exists() and Path(first["can"]).exists()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=10)
    assert (process.returncode, said) == (0, "")


def test_a_reader_that_goes_away_is_no_fault_of_the_program() -> None:
    process = start(*RIG, "check", ROOT / "rig.yaml")
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    said = process.stderr.read()
    process.stderr.close()
    assert process.wait(30) in (0, 130)
    assert "Internal error" not in said and "Exception" not in said


@pytest.mark.parametrize("line", [IDENTIFY_RUN, (*RIG, "check")], ids=["identify-run", "rig check"])
def test_a_wrong_file_is_answered_before_anything_heavy_is_loaded(line: tuple[str, ...]) -> None:
    program = f"import atexit, sys; atexit.register(lambda: print('numba' in sys.modules)); {line[2]}"
    process = start(line[0], "-c", program, *line[3:], "nowhere.yaml")
    told, said = process.communicate(timeout=30)
    assert process.returncode == 2
    assert "nowhere.yaml: no such file" in said
    assert told.strip() == "False"


@pytest.mark.parametrize("heading", ["Run", "Test"])
def test_the_readme_gives_one_line_to_run_and_one_to_test(heading: str) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = re.split(r"^## ", text.split(f"\n## {heading}\n")[1], flags=re.MULTILINE)[0]
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", section, flags=re.MULTILINE | re.DOTALL)
    assert [language for language, _ in blocks] == ["sh"]
    assert len(blocks[0][1].splitlines()) == 1


@posix
def test_a_disk_that_takes_no_more_ends_in_130_with_what_there_is_exported(tmp_path: Path) -> None:
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000)); {RIG[2]}"
    process = start(RIG[0], "-c", limited, "play", ROOT / "rig.yaml", "--out", tmp_path / "out")
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "recording.journal: File too large" in said and "Traceback" not in said
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"recording.journal", "recording.h5"}
    assert len(read_recording_h5(tmp_path / "out" / "recording.h5").runs) == 1
