"""A follow-up on emulated devices: consent, raw bytes and recording of both parts, the real drivers in between."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rig.recording.hdf5 import read_recording_h5
from tests.system.test_bench_commands import BENCH, SHORT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="emulated devices need pseudo terminals"),
]
# What is looked at is the playing, not the finding: the first identification is made to doubt, and a plan is given.
DOUBTING = """
from dataclasses import replace
import identify.follow_up.planner
import identify.pipeline
from commands.identify_run import main
from identify.results import FollowUp, FollowUpPlan, Parting

certain, pair = identify.pipeline.identify, ("coulomb_friction", "stribeck_friction")
SET = {"kind": "sine", "torque_nm": 10.0, "frequency_hz": 4.0, "duration_s": 1.0, "name": "follow-up: 4 Hz"}
EXCITATION = {"sample_rate_hz": 1000.0, "rest_s": 0.5, "scale_to_limits": True, "sets": [SET]}


def doubting(recording, *more):
    found = certain(recording, *more)
    rivals = {pair[0]: pair[1:]} if len(recording.runs) == 2 else {}
    return replace(found, verdict=replace(found.verdict, effects=pair[:1], confusable_with=rivals))


def planned(found, *more):
    if not found.verdict.confusable_with:
        return None
    return FollowUp(FollowUpPlan(EXCITATION, (Parting(*pair, 99.0),), 1.0, "A sine parts them."))


identify.pipeline.identify, identify.follow_up.planner.plan_follow_up = doubting, planned
main()
"""


def identify_run(log: Path, out: Path, *more: str) -> int:
    line = [sys.executable, "-c", DOUBTING, str(BENCH), "--out", str(out), *more]
    for override in SHORT:
        line += ["--set", override]
    with log.open("wb") as stream:
        return subprocess.run(line, stdout=stream, stderr=stream, stdin=subprocess.DEVNULL, check=False).returncode


def test_both_parts_are_played_recorded_and_kept_byte_for_byte(tmp_path: Path) -> None:
    log, out = tmp_path / "live.log", tmp_path / "live"
    code = identify_run(log, out, "--emulate", "--set", "identify.follow_up=auto")
    said = log.read_text()
    assert code in (0, 1), said
    assert said.count("Torque is EMULATED") == 2
    recording = read_recording_h5(out / "recording.h5")
    assert [run.name for run in recording.runs][2:] == ["follow-up: 4 Hz"]
    parts = (recording.info, recording.info["follow_ups"][0])
    for part in parts:
        assert part["emulated_drive"][-1]["torque_nm"][1] == 0.0
    assert (out / "raw" / "wire.cap").exists() and (out / "raw" / "follow_up" / "wire.cap").exists()


def test_asked_without_a_terminal_the_devices_are_not_even_contacted_again(tmp_path: Path) -> None:
    log, out = tmp_path / "live.log", tmp_path / "live"
    code = identify_run(log, out, "--emulate", "--yes")
    said = log.read_text()
    assert code in (0, 1), said
    assert said.count("Torque is EMULATED") == 1
    assert len(read_recording_h5(out / "recording.h5").runs) == 2
    assert (out / "follow_up.yaml").exists() and not (out / "raw" / "follow_up").exists()
