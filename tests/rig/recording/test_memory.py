"""A damaged reference to a text does not cost gigabytes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from benchmarks.fuzz.files import HARMFUL
from rig.errors import RecordingError
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
    assert "is no HDF5 file that can be read" in said
    assert int(used_mib) < 600


def test_a_column_of_texts_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = ["a", "b"]
    (table,) = read_file(path)
    with pytest.raises(RecordingError, match="'time_s' holds texts or lists, not numbers: save it as numbers"):
        table.read(["time_s"])  # type: ignore[union-attr]
