"""recording.h5: all of a campaign in one file, and back again without a bit changed.

/             attributes: format, version, axis, noise; info: JSON (versions, config as read)
/runs/000/    attributes: name, use, torque_hold, ...; datasets: time_s, rate_rad_s, valid, torque_nm, ...;
              channels/<name>, with kind, unit, reference and factor where it was declared as a cause
/journal/000/ attributes: name, meta (JSON); a dataset a kind (samples, commands, clocks) with its columns
/events       one JSON text each
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rig.arrays import Array
from rig.channels import KINDS, Channel
from rig.errors import RecordingError
from rig.recording.h5_heaps import check_heaps
from rig.recording.journal import JournalError
from rig.recording.journal_reader import JournalContents
from rig.recording.memory import at_most
from rig.recording.run import Recording, Run

FORMAT = "isp-rig recording"
FORMAT_VERSION = 1
_ARRAYS = ("time_s", "valid", "rate_rad_s", "angle_rad", "torque_time_s", "torque_nm")
_NUMBERS = ("min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "rate_corner_hz", "rate_delay_s")
_VALUES = ("name", "torque_hold", "use", *_NUMBERS)
# What h5py raises over a damaged file; a link that leads nowhere reads as None.
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, MemoryError, RecursionError)
# The library takes what a damaged reference to a text says it is long, up to 4 GiB, before it looks for the text.
MAX_TEXT_BYTES = 256 << 20
MAX_READ_BYTES = 2 << 30  # all that is read, twice
MAX_RECORDED_VALUES = 60_000_000  # half a gigabyte of numbers: an hour of six channels at 2 kHz is a third of it


def write_recording_h5(path: str | Path, recording: Recording, journal: JournalContents | None = None) -> None:
    """Write ``recording`` and, where it was played here, the journal it came from; never over a file.

    Raises JournalError where the disk is full or the file exists; nothing is left half written.
    """
    path = Path(path)
    partial = path.with_name(path.name + ".part")
    if path.exists():
        raise JournalError(f"{path} exists and is never overwritten: choose another --out")
    try:
        partial.write_bytes(_image(recording, journal))
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise JournalError(
            f"cannot write {path}: {error.strerror or error}. The raw journal keeps everything: free space, then "
            "export it again"
        ) from error


def _image(recording: Recording, journal: JournalContents | None) -> bytes:
    """The bytes of the file, made in memory: on a full disk the HDF5 library crashes instead of raising."""
    with h5py.File("recording.h5", "w", driver="core", backing_store=False) as file:
        _write(file, recording, journal)
        file.flush()
        return bytes(file.id.get_file_image())


def _write(file: h5py.File, recording: Recording, journal: JournalContents | None) -> None:
    file.attrs.update({"format": FORMAT, "version": FORMAT_VERSION, "axis": recording.axis})
    if recording.noise is not None:
        file.attrs["noise"] = recording.noise
    file["info"] = json.dumps(recording.info, default=str)
    for i, run in enumerate(recording.runs):
        _write_run(file.create_group(f"runs/{i:03d}"), run)
    if journal is None:
        return
    for i, played in enumerate(journal.runs):
        group = file.create_group(f"journal/{i:03d}")
        group.attrs.update({"name": played.name, "meta": json.dumps(played.meta, default=str), "ended": played.ended})
        for kind, rows in played.tables.items():
            dataset = group.create_dataset(kind, data=rows, **_packed(rows))
            dataset.attrs["columns"] = list(played.columns[kind])
    events = [json.dumps({"time_s": e.time_s, "text": e.text, "values": e.values}) for e in journal.events]
    file.create_dataset("events", data=events, dtype=h5py.string_dtype(), shape=(len(events),))


def _packed(rows: Any) -> dict[str, Any]:
    return {"compression": "gzip", "compression_opts": 1, "shuffle": True} if rows.size > 1000 else {}


def _write_run(group: h5py.Group, run: Run) -> None:
    for name in _VALUES:
        value = getattr(run, name)
        if value is not None:
            group.attrs[name] = value
    for name in _ARRAYS:
        array = getattr(run, name)
        if array is not None:
            group.create_dataset(name, data=array, **_packed(array))
    for name, array in run.channels.items():
        dataset = group.create_dataset(f"channels/{_word(name)}", data=array, **_packed(array))
        if name in run.causes:
            given = {key: value for key, value in vars(run.causes[name]).items() if key != "name" and value is not None}
            dataset.attrs.update(given)


def _word(name: str) -> str:
    """A channel's name as one that HDF5 takes: there a slash leads into a group, and nothing and a dot are no names."""
    word = name.replace("/", "_").replace("\0", "_")
    return word if word.strip(".") else f"channel_{word}"


def read_recording_h5(path: str | Path, *, with_info: bool = True) -> Recording:
    """The Recording that was written, bit for bit; without its ``info`` where nobody reads that.

    Raises RecordingError where the file is not ours or damaged.
    """
    try:
        check_heaps(path)
        with h5py.File(path, "r") as file, at_most(MAX_READ_BYTES):
            with at_most(MAX_TEXT_BYTES):
                if file.attrs.get("format") != FORMAT:
                    raise RecordingError(
                        f"{path}: is not a recording of this program: map its columns under `recorded`"
                    )
                if int(file.attrs["version"]) > FORMAT_VERSION:
                    raise RecordingError(f"{path}: written by a later version: read it with that one")
                noise, axis = file.attrs.get("noise"), file.attrs["axis"]
                info = json.loads(file["info"][()]) if with_info else {}
            reader = _Reader(path)
            return Recording(
                runs=tuple(reader.run(group) for _, group in sorted(file["runs"].items())),
                axis="linear" if axis == "linear" else "rotary",
                noise=None if noise is None else float(noise),
                info=info if isinstance(info, dict) else {},
            )
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is damaged ({error}): export it again from the raw journal") from error


class _Reader:
    """Takes runs out of a file that may have been made to exhaust the memory or to reach into other files."""

    def __init__(self, path: str | Path) -> None:
        self._path = path
        self._values_left = MAX_RECORDED_VALUES

    def run(self, group: h5py.Group) -> Run:
        """One run. Raises RecordingError, or what _DAMAGE lists."""
        with at_most(MAX_TEXT_BYTES):
            values: dict[str, Any] = {name: group.attrs[name] for name in _VALUES if name in group.attrs}
        values = {name: float(value) if name in _NUMBERS else str(value) for name, value in values.items()}
        arrays: dict[str, Any] = {name: self._numbers(group, name) for name in _ARRAYS if name in group}
        arrays["valid"] = np.asarray(arrays["valid"], dtype=bool)
        inner = group.get("channels", {})
        channels = {name: self._numbers(inner, name) for name in inner}
        with at_most(MAX_TEXT_BYTES):
            causes = {name: _cause(name, inner[name].attrs) for name in inner if inner[name].attrs.get("kind") in KINDS}
        return Run(**values, **arrays, channels=channels, causes=causes)

    def _numbers(self, group: Any, name: str) -> Array:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise RecordingError(f"{self._path}: {name!r} is a link to another place: copy the values in (h5repack)")
        data = group[name]
        if not isinstance(data, h5py.Dataset) or data.external or data.is_virtual or data.ndim != 1:
            raise RecordingError(f"{self._path}: {name!r} is not a plain column in this file: copy it in (h5repack)")
        if data.dtype.kind not in "fiub":
            raise RecordingError(f"{self._path}: {name!r} holds {data.dtype} values, not numbers")
        self._values_left -= data.size
        if self._values_left < 0:
            raise RecordingError(
                f"{self._path}: holds more than {MAX_RECORDED_VALUES} values: cut it into several recordings"
            )
        return np.asarray(data[()], dtype=np.float64)


def _cause(name: str, attrs: Any) -> Channel:
    numbers = {key: float(attrs[key]) for key in ("reference", "factor") if key in attrs}
    return Channel(name, attrs["kind"], str(attrs.get("unit", "")), **numbers)
