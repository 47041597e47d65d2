"""Files with changed bytes, of every format, are read or refused; nothing else ever happens.

The seeds are fixed, so that what was found once stays found: SciPy's .mat reader crashed on such files.
"""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rig.errors import RecordingError
from rig.recording import Journal, Recording, Run
from rig.recording.guessing.columns import columns_of
from rig.recording.hdf5 import write_recording_h5
from rig.recording.readers import read_file
from tests.commands.rig import exported_matlab, exported_more
from tests.rig.recording.support import csv_of, motion, read

UNITS = {"time_s": "s", "torque_nm": "N m", "rate_rad_s": "rad/s", "angle_rad": "rad"}


def make(path: Path) -> None:
    columns = motion(60)
    stem = path.stem
    if stem == "csv":
        path.write_text(csv_of(columns))
    elif stem.startswith("npz"):
        (np.savez_compressed if stem.endswith("packed") else np.savez)(path, **columns)
    elif stem.startswith("mat"):
        content = {"log": columns} if stem.endswith("struct") else columns
        version = "4" if stem.endswith("old") else "5"
        scipy.io.savemat(path, content, format=version, do_compression=stem.endswith("packed"))
    elif stem == "h5":
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file[name] = values
                file[name].attrs["units"] = UNITS[name]
    elif stem == "own":
        run = Run("r", columns["time_s"], np.ones(60, dtype=bool), columns["rate_rad_s"])
        write_recording_h5(path, Recording((run,)))
    else:
        with Journal.create(path, {}) as journal:
            journal.begin_run("r", {"use": "fit"})
            journal.append("samples", np.column_stack((columns["time_s"], columns["rate_rad_s"], np.ones(60))))


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """``data`` with up to five bytes changed, a stretch cut out, or its end cut off."""
    changed = bytearray(data)
    for _ in range(random.integers(1, 6)):
        # Headers decide how the rest is read: half of the changes go there.
        end = min(len(changed), 600) if random.random() < 0.5 else len(changed)
        at = int(random.integers(0, max(1, end)))
        what = random.random()
        if what < 0.8:
            changed[at : at + 1] = random.bytes(1)
        elif what < 0.9:
            changed[at : at + 4] = b"\xff\xff\xff\xff"
        elif what < 0.97:
            del changed[at : at + int(random.integers(1, 30))]
        else:
            del changed[at + 1 :]
    return bytes(changed)


@pytest.mark.parametrize(
    "name",
    [
        "csv.csv",
        "npz.npz",
        "npz_packed.npz",
        "mat.mat",
        "mat_packed.mat",
        "mat_struct.mat",
        "mat_old.mat",
        "h5.h5",
        "own.h5",
        "raw.journal",
    ],
)
def test_a_mutated_recording_is_read_or_refused(tmp_path: Path, name: str) -> None:
    random = np.random.default_rng(2024)
    make(tmp_path / name)
    original = (tmp_path / name).read_bytes()
    outcomes = {"read": 0, "refused": 0}
    for _ in range(100):
        (tmp_path / name).write_bytes(mutated(original, random))
        try:
            runs = read(tmp_path, name).runs
        except RecordingError as error:
            assert str(error).startswith(str(tmp_path / name)), "the message begins with the file"
            outcomes["refused"] += 1
        else:
            assert all(np.isfinite(run.time_s).all() and len(run.time_s) >= 20 for run in runs)
            outcomes["read"] += 1
    assert outcomes["refused"] > 10


MADE = {**exported_matlab.READ, **{name: exported_more.READ[name] for name in ("bench.xlsx", "numbers.xlsx")}}


@pytest.mark.parametrize("name", MADE)
def test_mutated_structures_are_columns_or_refused(tmp_path: Path, name: str) -> None:
    random = np.random.default_rng(2024)
    MADE[name][0](tmp_path / name)
    original = (tmp_path / name).read_bytes()
    for _ in range(60):
        (tmp_path / name).write_bytes(mutated(original, random))
        try:
            for table in read_file(tmp_path / name):
                assert not isinstance(table, Run)
                columns_of(table)
        except RecordingError as error:
            assert str(error).startswith(str(tmp_path / name)), "the message begins with the file"


def test_a_text_that_claims_rows_without_end_is_read_at_once(tmp_path: Path) -> None:
    """A changed shape, 600 000 000 x 0, of a text had been walked through row by row."""
    scipy.io.savemat(tmp_path / "r.mat", motion(60) | {"note": "abcd"})
    data = (tmp_path / "r.mat").read_bytes()
    shape, text = struct.pack("<IIii", 5, 8, 1, 4), data.index(b"abcd")
    changed = bytearray(data.replace(shape, struct.pack("<IIii", 5, 8, 600_000_000, 0)))
    changed[text - 2 : text] = b"\0\0"
    changed[text : text + 4] = bytes(4)
    (tmp_path / "r.mat").write_bytes(bytes(changed))
    (run,) = read(tmp_path, "r.mat").runs
    assert len(run.time_s) == 60
