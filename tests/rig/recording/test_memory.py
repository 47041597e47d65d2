"""Damaged texts in an HDF5 file cost neither gigabytes nor for ever."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from benchmarks.fuzz.files import HARMFUL
from rig.errors import RecordingError
from rig.recording import h5_heaps
from rig.recording.memory import at_most
from rig.recording.readers import read_file

if sys.platform != "linux":
    pytest.skip("other systems have no limit that holds", allow_module_level=True)

import resource


def test_what_is_beyond_the_limit_is_refused_and_the_limit_goes_with_the_block() -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    with at_most(64 << 20):
        assert len(bytearray(1 << 20)) == 1 << 20
        with pytest.raises(MemoryError):
            bytearray(1 << 30)
        with at_most(16 << 20):
            pass
        with pytest.raises(MemoryError):
            bytearray(1 << 30)
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    assert len(bytearray(1 << 28)) == 1 << 28


READ = """
import re, sys
from pathlib import Path
from rig.recording.readers import read_file
from rig.errors import RecordingError
try:
    read_file(Path(sys.argv[1]))
except RecordingError as refusal:
    print(refusal)
print(int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text()).group(1)) >> 10)
"""


def test_a_text_that_claims_gigabytes_is_refused_before_they_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "own.h5"
    HARMFUL["refuse own_long_text.h5"](path)
    done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True)
    said, used_mib = done.stdout.splitlines()
    assert "is not an HDF5 file that can be read" in said
    assert int(used_mib) < 600


def test_a_column_of_texts_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = ["a", "b"]
    (table,) = read_file(path)
    with pytest.raises(RecordingError, match="'time_s' holds texts or lists, not numbers: save it as numbers"):
        table.read(["time_s"])  # type: ignore[union-attr]


def test_more_texts_than_a_recording_has_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["notes"] = [f"note {k}" for k in range(200)]
    read_file(path)
    monkeypatch.setattr(h5_heaps, "MAX_TEXTS", 150)
    with pytest.raises(RecordingError, match="holds more than 150 texts"):
        read_file(path)


def test_a_file_with_a_block_of_its_user_before_it_is_walked_too(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w", userblock_size=1024) as file:
        file["time_s"] = [0.0, 1.0]
        file.attrs["note"] = "a text"
    read_file(path)
    data = bytearray(path.read_bytes())
    at = data.index(b"GCOL") + 16 + 16 + 8
    data[at : at + 16] = bytes(16)
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="its string heap is endless"):
        read_file(path)
