"""recording.h5 gives back the Recording that was written, bit for bit."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording import Journal, JournalError, Recording, Run, read_journal, recording_from_journal
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from tests.rig.recording.support import motion, read


def assert_same(one: Recording, other: Recording) -> None:
    assert (one.axis, one.noise, one.info) == (other.axis, other.noise, other.info)
    assert len(one.runs) == len(other.runs)
    for a, b in zip(one.runs, other.runs, strict=True):
        for field in fields(Run):
            left, right = getattr(a, field.name), getattr(b, field.name)
            if field.name == "channels":
                assert left.keys() == right.keys()
                for key in left:
                    np.testing.assert_array_equal(left[key], right[key])
            elif isinstance(left, np.ndarray):
                assert left.dtype == right.dtype
                np.testing.assert_array_equal(left, right)
            else:
                assert left == right, field.name


def recording() -> Recording:
    random = np.random.default_rng(1)
    values = random.normal(size=(5, 2000))
    values[1, 7] = np.nan
    valid = np.arange(2000) != 7
    full = Run(
        "0.5 Hz",
        np.arange(2000) / 3,
        valid,
        values[1],
        values[2],
        np.arange(2000) / 3 + 1e-4,
        values[3],
        "zero_order",
        "holdout",
        0.1,
        1e-3,
        0.5,
        {"temperature_c": values[4]},
    )
    decay = Run("decay", np.arange(30) * 0.1, np.ones(30, dtype=bool), angle_rad=values[0, :30])
    info = {"backend": "bench", "config_text": "backend: bench\n# ü\n", "versions": {"isp-rig": "0.1.0"}}
    return Recording((full, decay), "linear", 0.002, info)


def test_nothing_changes_on_the_way_to_the_file_and_back(tmp_path: Path) -> None:
    write_recording_h5(tmp_path / "recording.h5", recording())
    assert_same(read_recording_h5(tmp_path / "recording.h5"), recording())


def test_the_journal_is_exported_with_commands_and_events(tmp_path: Path) -> None:
    with Journal.create(tmp_path / "a.journal", {"axis": "rotary", "noise": None}) as journal:
        journal.begin_run("r", {"frequency_hz": 2.0})
        journal.append("samples", [(k * 1e-3, 1.0 * k, 1.0) for k in range(10)])
        journal.append("commands", [(k * 1e-3, 2.0 * k, 2.5 * k) for k in range(10)])
        journal.event(0.004, "late", {"by_ms": 2})
        journal.end_run()
    contents = read_journal(tmp_path / "a.journal")
    made = recording_from_journal(contents)
    write_recording_h5(tmp_path / "recording.h5", made, contents)
    assert_same(read_recording_h5(tmp_path / "recording.h5"), made)
    with h5py.File(tmp_path / "recording.h5") as file:
        commands = file["journal/000/commands"]
        assert list(commands.attrs["columns"]) == ["time_s", "torque_nm", "torque_commanded_nm"]
        assert commands[3].tolist() == [0.003, 6.0, 7.5]
        assert b'"late"' in file["events"][0]


def test_our_own_file_is_a_recording_to_identify_from(tmp_path: Path) -> None:
    columns = motion()
    run = Run("2 Hz", columns["time_s"], np.ones(500, dtype=bool), columns["rate_rad_s"], frequency_hz=2.0)
    write_recording_h5(tmp_path / "recording.h5", Recording((run, run)))
    runs = read(tmp_path, "recording.h5", entry="      use: fit\n").runs
    assert [(r.name, r.frequency_hz, r.use) for r in runs] == [("2 Hz #1", 2.0, "fit"), ("2 Hz #2", 2.0, "fit")]


def test_columns_make_no_sense_for_our_own_file(tmp_path: Path) -> None:
    write_recording_h5(tmp_path / "recording.h5", recording())
    with pytest.raises(RecordingError, match=r"SI units under its own names: leave recorded\.columns"):
        read(tmp_path, "recording.h5", "  scale: {torque: 2}\n")


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"use": "maybe"}, "was changed after it was written"),
        ({"torque_hold": "?"}, "was changed after it was written"),
        ({"frequency_hz": float("nan")}, "was changed after it was written"),
        ({"torque_time_s": None}, "was changed after it was written"),
        ({"rate_rad_s": np.ones(3)}, "columns of different length"),
        ({"rate_rad_s": np.full(2000, np.nan)}, "rate at sample 0 is nan though valid"),
        ({"torque_nm": np.full(2000, np.inf)}, "a torque is not a number"),
    ],
)
def test_our_own_file_is_checked_like_any_other(tmp_path: Path, change: dict[str, Any], cause: str) -> None:
    run = replace(recording().runs[0], **change)
    write_recording_h5(tmp_path / "recording.h5", Recording((run,)))
    with pytest.raises(RecordingError, match=cause):
        read(tmp_path, "recording.h5")


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "recording.h5").write_text("precious")
    with pytest.raises(JournalError, match="never overwritten: choose another --out"):
        write_recording_h5(tmp_path / "recording.h5", recording())
    assert (tmp_path / "recording.h5").read_text() == "precious"


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
def test_a_disk_that_takes_no_more_is_an_error_and_not_a_crash(tmp_path: Path) -> None:
    import resource  # noqa: PLC0415 (not there on Windows)

    noise = np.random.default_rng(1).standard_normal(100_000)
    run = Run("noise", np.arange(100_000.0), np.ones(100_000, dtype=bool), rate_rad_s=noise)
    earlier = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, earlier[1]))
    try:
        with pytest.raises(JournalError, match="File too large"):
            write_recording_h5(tmp_path / "recording.h5", Recording((run,)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, earlier)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_half_written(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="The raw journal keeps everything"):
        write_recording_h5(tmp_path / "gone" / "recording.h5", recording())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("damage", ["other", "later", "cut"])
def test_a_file_that_is_not_ours_is_refused(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "recording.h5"
    write_recording_h5(path, recording())
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:4000])
    else:
        with h5py.File(path, "a") as file:
            file.attrs["format" if damage == "other" else "version"] = 99
    cure = {"other": "map its columns", "later": "read it with that one", "cut": "export it again"}[damage]
    with pytest.raises(RecordingError, match=cure):
        read_recording_h5(path)
