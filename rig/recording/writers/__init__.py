"""Writers of recordings for other programs, one a format; a new one is a new file and a line in ``_BY_NAME``.

HDF5 is the recording itself (rig.recording.hdf5). What is written here is read back by our own readers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

from rig.arrays import Array

Writer = Callable[[Path, Mapping[str, Array]], None]
_BY_NAME = {"csv": "csv_text", "mat": "mat", "npz": "npz"}
_NOT_IN_A_FILE_NAME = re.compile(r"[^\w.-]+")


def names() -> tuple[str, ...]:
    """Every format that runs can be written in."""
    return tuple(_BY_NAME)


def writer_of(name: str) -> Writer:
    """The writer of a format: takes a path that is free and columns of one length. Raises KeyError."""
    write: Writer = import_module(f"rig.recording.writers.{_BY_NAME[name]}").write
    return write


def file_name(number: int, run: str, suffix: str) -> str:
    """A name that every system takes, whatever the run is called."""
    return f"{number:03d}_{_NOT_IN_A_FILE_NAME.sub('_', run).strip('._')[:60] or 'run'}.{suffix}"
