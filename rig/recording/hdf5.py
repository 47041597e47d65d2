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

from rig.channels import KINDS, Channel
from rig.errors import RecordingError
from rig.recording.journal import JournalError
from rig.recording.journal_reader import JournalContents
from rig.recording.run import Recording, Run

FORMAT = "isp-rig recording"
VERSION = 1
_ARRAYS = ("time_s", "valid", "rate_rad_s", "angle_rad", "torque_time_s", "torque_nm")
_NUMBERS = ("min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "rate_corner_hz", "rate_delay_s")
_VALUES = ("name", "torque_hold", "use", *_NUMBERS)
# What h5py raises over a damaged file; a link that leads nowhere reads as None.
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError)


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
    file.attrs.update({"format": FORMAT, "version": VERSION, "axis": recording.axis})
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


def read_recording_h5(path: str | Path) -> Recording:
    """The Recording that was written, bit for bit. Raises RecordingError where the file is not ours or damaged."""
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise RecordingError(f"{path}: is no recording of this program: map its columns under `recorded`")
            if int(file.attrs["version"]) > VERSION:
                raise RecordingError(f"{path}: written by a later version: read it with that one")
            noise = file.attrs.get("noise")
            return Recording(
                runs=tuple(_read_run(group) for _, group in sorted(file["runs"].items())),
                axis=str(file.attrs["axis"]),  # type: ignore[arg-type]
                noise=None if noise is None else float(noise),
                info=json.loads(file["info"][()]),
            )
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is damaged ({error}): export it again from the raw journal") from error


def _read_run(group: h5py.Group) -> Run:
    values: dict[str, Any] = {name: group.attrs[name] for name in _VALUES if name in group.attrs}
    for name in _NUMBERS:
        if name in values:
            values[name] = float(values[name])
    arrays = {name: group[name][()] for name in _ARRAYS if name in group}
    arrays["valid"] = np.asarray(arrays["valid"], dtype=bool)
    datasets = dict(group.get("channels", {}).items())
    channels = {name: data[()] for name, data in datasets.items()}
    causes = {name: _cause(name, data.attrs) for name, data in datasets.items() if data.attrs.get("kind") in KINDS}
    return Run(**values, **arrays, channels=channels, causes=causes)


def _cause(name: str, attrs: Any) -> Channel:
    numbers = {key: float(attrs[key]) for key in ("reference", "factor") if key in attrs}
    return Channel(name, attrs["kind"], str(attrs.get("unit", "")), **numbers)
