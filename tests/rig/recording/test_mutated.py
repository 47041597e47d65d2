"""Files with changed bytes, of every format, are read or refused; nothing else ever happens.

The seeds are fixed, so that what was found once stays found: SciPy's .mat reader crashed on such files.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from rig.errors import RecordingError
from rig.recording import Journal, Recording, Run
from rig.recording.hdf5 import write_recording_h5
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
