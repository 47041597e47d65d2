"""Every recording whose numbers cannot be trusted is refused with its cause and its cure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.rig.recording.support import motion, refusal

Columns = dict[str, Any]


def changed(**columns: Any) -> Columns:
    return motion() | columns


def without(*names: str) -> Columns:
    return {name: values for name, values in motion().items() if name not in names}


def with_value(column: str, index: int, value: float) -> Columns:
    columns = motion()
    columns[column] = columns[column].copy()
    columns[column][index] = value
    return columns


T = motion()["time_s"]

# columns of run.npz, keys of `recorded`, keys of the run, then what the message has to say: cause, cure
ARRAYS: dict[str, tuple[Columns, str, str, str, str]] = {
    "no time": (without("time_s"), "", "", "no column 'time_s'", "recorded.columns.time"),
    "neither rate nor angle": (
        without("rate_rad_s", "angle_rad"),
        "",
        "",
        "no column 'rate_rad_s' or 'rate_deg_s' or 'angle_rad' or 'angle_deg' (it has: time_s, torque_nm)",
        "recorded.columns.rate",
    ),
    "misspelt time": (
        {"times": T, **without("time_s")},
        "",
        "",
        "no column 'time_s', did you mean 'times'?",
        "recorded.columns.time",
    ),
    "mapped column missing": (
        motion(),
        "  columns: {torque: torque}\n",
        "",
        "no column 'torque', did you mean 'torque_nm'?",
        "correct recorded.columns.torque",
    ),
    "NaN that is said to be valid": (
        with_value("torque_nm", 7, np.nan) | {"valid": np.ones(500)},
        "",
        "",
        "index 7: torque is nan",
        "mark the row valid = 0",
    ),
    "no value in any row": (
        changed(torque_nm=np.full(500, np.nan)),
        "",
        "",
        "torque has no value in any of 500 rows",
        "recorded.columns.torque",
    ),
    "infinite": (with_value("rate_rad_s", 9, -np.inf), "", "", "index 9: rate is -inf", "delete the row"),
    "NaN in time": (with_value("time_s", 3, np.nan), "", "", "index 3: time is nan", "correct it"),
    "absurd value": (with_value("rate_rad_s", 9, 3e200), "", "", "rate is 3e+200", "correct it"),
    "unsorted time": (with_value("time_s", 5, 0.0015), "", "", "time is not sorted", "sort the rows"),
    "duplicate time": (with_value("time_s", 5, 0.004), "", "", "samples 4 and 5 have the same time", "more digits"),
    "time in ms": (changed(time_s=T * 1e3), "", "", "time is in milliseconds", "recorded.scale.time: 0.001"),
    "time in ms, rate only": (
        {k: v for k, v in changed(time_s=T * 1e3).items() if k != "angle_rad"},
        "",
        "",
        "the time looks like milliseconds",
        "recorded.scale.time: 0.001; if it is in seconds, set",
    ),
    "time in us, rate only": (
        {k: v for k, v in changed(time_s=T * 1e6).items() if k != "angle_rad"},
        "",
        "",
        "the time looks like microseconds",
        "recorded.scale.time: 0.000001",
    ),
    "two samples": (
        {k: v[:2] for k, v in motion().items()},
        "",
        "",
        "2 valid samples, at least 40",
        "record longer",
    ),
    "no samples": ({k: v[:0] for k, v in motion().items()}, "", "", "0 valid samples", "record longer"),
    "all samples lost": (changed(valid=np.zeros(500)), "", "", "0 valid samples", "record longer"),
    "nothing happens": (
        {"time_s": T, "torque_nm": np.full(500, 2.0), "rate_rad_s": np.full(500, 0.3)},
        "",
        "",
        "the rate never changes (0.3) and the torque is constant too",
        "record a run in which the torque changes",
    ),
    "stuck sensor": (
        {**without("angle_rad"), "rate_rad_s": np.zeros(500)},
        "",
        "",
        "the rate never changes (0) though the torque does",
        "check that the sensor was connected",
    ),
    "at rest without torque": (
        {"time_s": T, "angle_rad": np.zeros(500)},
        "",
        "",
        "the angle never changes (0) and there is no torque",
        "record a run",
    ),
    "angle and rate swapped": (
        changed(angle_rad=motion()["rate_rad_s"], rate_rad_s=motion()["angle_rad"]),
        "",
        "",
        "the columns of angle and rate seem to be swapped",
        "exchange recorded.columns.angle and recorded.columns.rate",
    ),
    "angle and rate of several tones swapped": (
        changed(
            rate_rad_s=0.05 * np.sin(40 * T) + 0.1 * np.sin(15 * T), angle_rad=2 * np.cos(40 * T) + 1.5 * np.cos(15 * T)
        ),
        "",
        "",
        "what was read as the angle is the derivative of what was read as the rate",
        "exchange recorded.columns.angle and recorded.columns.rate",
    ),
    "angle in degrees": (
        changed(angle_rad=np.degrees(motion()["angle_rad"])),
        "",
        "",
        "57.3 times as fast as the rate says; probably the angle is in degrees",
        "recorded.scale.angle: 0.0174533",
    ),
    "rate in degrees": (
        changed(rate_rad_s=np.degrees(motion()["rate_rad_s"])),
        "",
        "",
        "the rate is in degrees per second",
        "recorded.scale.rate: 0.0174533",
    ),
    "rate reversed": (
        changed(rate_rad_s=-motion()["rate_rad_s"]),
        "",
        "",
        "opposite signs",
        "recorded.scale.rate: -1",
    ),
    "rate in rpm": (
        changed(rate_rad_s=motion()["rate_rad_s"] * 30 / np.pi),
        "",
        "",
        "turns per minute",
        "recorded.scale.rate: 0.10472",
    ),
    "rate off by 1.3": (
        changed(rate_rad_s=motion()["rate_rad_s"] / 1.3),
        "",
        "",
        "1.3 times as fast",
        "recorded.scale.rate: 1.3",
    ),
    "angle jumps": (
        changed(angle_rad=0.05 * np.sin(40 * T) + 0.5 * (T > 0.2)),
        "",
        "",
        "jumps by 0.49",
        "split the run there",
    ),
    "columns of different length": (
        changed(torque_nm=np.ones(499)),
        "",
        "",
        "different length (time 500, torque 499, rate 500, angle 500)",
        "one value per sample",
    ),
    "complex": (changed(torque_nm=np.ones(500) * 1j), "", "", "complex numbers", "save its real part"),
    "text array": (changed(torque_nm=np.array(["1.0"] * 500)), "", "", "not numbers", "save it as numbers"),
    "structured": (
        changed(torque_nm=np.zeros(500, dtype=[("a", float), ("b", float)])),
        "",
        "",
        "a structure of a, b",
        "its own array",
    ),
    "two-dimensional": (changed(torque_nm=np.ones((500, 3))), "", "", "shape (500, 3)", "an array of its own"),
    "single number": (changed(torque_nm=np.float64(1)), "", "", "a single number", "one value per sample"),
    "window outside": (
        motion(),
        "",
        "      from_s: 3\n",
        "no sample between from_s = 3",
        "the file runs from 0 to 0.499 s",
    ),
    "window too narrow": (motion(), "", "      to_s: 0.005\n", "6 valid samples", "widen from_s and to_s"),
    "dead encoder": (changed(angle_rad=np.full(500, 0.3)), "", "", "the angle never changes (0.3)", "encoder"),
    "next to no time": (changed(time_s=1e-290 * motion()["time_s"]), "", "", "1e-293 s apart", "recorded.scale.time"),
    "next to no torque": (changed(torque_nm=1e-200 * motion()["time_s"]), "", "", "the torque never exceeds", "scale"),
    "a scale beyond all": (
        motion(),
        "  scale: {torque: 1.0e+300}\n",
        "",
        "the torque reaches",
        "recorded.scale.torque",
    ),
    "valid is a half": (changed(valid=np.full(500, 0.5)), "", "", "index 0: valid is 0.5", "write 1 for a good sample"),
    "valid is NaN": (changed(valid=np.full(500, np.nan)), "", "", "valid is empty", "write 1 for a good sample"),
}


@pytest.mark.parametrize("case", ARRAYS)
def test_arrays_that_cannot_be_trusted_are_refused(tmp_path: Path, case: str) -> None:
    columns, options, entry, cause, cure = ARRAYS[case]
    np.savez(tmp_path / "run.npz", **columns)
    message = refusal(tmp_path, "run.npz", options, entry)
    assert cause in message
    assert cure in message
