"""Readers of recordings, one a format, found by suffix; a new one is a new file and a line in ``_BY_SUFFIX``.

Those that need a library of an extra are in ``rig.recording.extra_readers``.
"""

from __future__ import annotations

import stat
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.readers import can_log
from rig.recording.readers.folder import is_ros_bag
from rig.recording.run import Run
from rig.recording.table import Table

MAX_RECORDING_BYTES = 2 * 1024**3

# Longest first where one suffix ends another. The modules load when asked for: SciPy and HDF5 are slow to import.
_BY_SUFFIX = {
    ".csv.gz": "readers.text.csv_text",
    ".csv": "readers.text.csv_text",
    ".tsv": "readers.text.csv_text",
    ".txt": "readers.text.csv_text",
    ".lvm": "readers.text.csv_text",
    ".asc": "readers.text.csv_text",
    ".dat": "readers.text.csv_text",
    ".log": "readers.text.csv_text",
    ".prn": "readers.text.csv_text",
    ".jsonl": "readers.json_text",
    ".ndjson": "readers.json_text",
    ".json": "readers.json_text",
    ".npz": "readers.npz",
    ".npy": "readers.npz",
    ".mat": "readers.matlab.mat",
    ".hdf5": "readers.h5",
    ".h5": "readers.h5",
    ".journal": "readers.raw_journal",
    ".parquet": "extra_readers.parquet",
    ".mf4": "extra_readers.mf4",
    ".mdf": "extra_readers.mf4",
    ".tdms": "extra_readers.tdms",
    ".bag": "extra_readers.rosbag",
    ".xlsx": "extra_readers.spreadsheet",
    ".xls": "extra_readers.spreadsheet",
    ".ods": "extra_readers.spreadsheet",
    ".mcap": "extra_readers.rosbag",
    ".db3": "extra_readers.rosbag",
}


def suffixes() -> tuple[str, ...]:
    """Every suffix that can be read."""
    return tuple(sorted(_BY_SUFFIX))


def read_file(path: Path) -> Sequence[Table | Run]:
    """What the file holds: tables of named columns, or runs where this program wrote it.

    Raises RecordingError with cause and cure.
    """
    if _is_folder(path):
        return _read_with("extra_readers.rosbag" if is_ros_bag(path) else "readers.folder", path)
    _check_is_file(path)
    suffix = next((s for s in _BY_SUFFIX if path.name.lower().endswith(s)), None)
    if path.name.lower().endswith(can_log.SUFFIXES):
        raise can_log.undecoded(path)
    if suffix is None:
        raise RecordingError(
            f"{path}: the suffix {path.suffix!r} is not a known format: export it as one of {', '.join(suffixes())}"
        )
    if suffix == ".dat" and _begins_with(path, b"MDF "):  # INCA's
        suffix = ".mdf"
    return _read_with(_BY_SUFFIX[suffix], path)


def _begins_with(path: Path, head: bytes) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(head)) == head
    except OSError as error:
        raise RecordingError(f"{path}: cannot be opened: {error.strerror}; check path and permissions") from error


def _read_with(module: str, path: Path) -> Sequence[Table | Run]:
    contents: Sequence[Table | Run] = import_module(f"rig.recording.{module}").read(path)
    return contents


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _check_is_file(path: Path) -> None:
    try:
        status = path.stat()
    except FileNotFoundError:
        raise RecordingError(
            f"{path}: no such file: `file` is relative to the yaml; correct it or give an absolute path"
            + neighbours(path)
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RecordingError(f"{path}: cannot be opened: {reason}; check path and permissions") from error
    if not stat.S_ISREG(status.st_mode):
        # A pipe may never end and a device may never answer.
        raise RecordingError(f"{path}: is not a regular file (a pipe or device): save the data to a file first")
    if status.st_size == 0:
        raise RecordingError(f"{path}: the file is empty: export the recording again")
    if status.st_size > MAX_RECORDING_BYTES:
        raise RecordingError(
            f"{path}: {status.st_size / 1024**3:.1f} GiB, at most {MAX_RECORDING_BYTES / 1024**3:.0f} GiB are read: "
            "cut it into runs or lower its sample rate"
        )


def neighbours(path: Path) -> str:
    """Recordings that do stand in that folder, at most five."""
    try:
        found = sorted(p.name for p in path.parent.iterdir() if p.name.lower().endswith(tuple(_BY_SUFFIX)))
    except OSError:
        return f"; the folder {path.parent} is not there either"
    return f"; there are: {', '.join(found[:5])}" if found else ""
