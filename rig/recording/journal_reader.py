"""Reading a journal back, whole or cut off by a kill, and making a Recording of it."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rig.errors import RecordingError
from rig.recording.journal import (
    BLOCK,
    BLOCK_HEAD,
    CLOSE,
    EVENT,
    FRAME_HEAD,
    HEADER,
    MARKER,
    MAX_FRAME_BYTES,
    RUN,
    RUN_END,
)
from rig.recording.run import Array, Recording, Run

RUN_META = (
    "torque_hold", "use", "min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "rate_corner_hz", "rate_delay_s",
)  # fmt: skip


@dataclass(frozen=True)
class JournalRun:
    """One run as written: ``tables`` maps a kind to its rows, shape (n, columns)."""

    name: str
    meta: Mapping[str, Any]
    columns: Mapping[str, tuple[str, ...]]
    tables: Mapping[str, Array]
    ended: bool

    def column(self, kind: str, name: str) -> Array:
        """One column of one kind, shape (n,). Raises KeyError where there is none."""
        if name not in self.columns[kind]:
            raise KeyError(name)
        return self.tables[kind][:, self.columns[kind].index(name)]


@dataclass(frozen=True)
class JournalEvent:
    """Something that happened, with the time and values the writer gave."""

    time_s: float
    text: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class JournalContents:
    """All that could be read.

    ``closed`` is False where the writer was killed; ``unread_bytes`` counts the tail that was cut off.
    """

    header: Mapping[str, Any]
    runs: tuple[JournalRun, ...]
    events: tuple[JournalEvent, ...]
    closed: bool
    unread_bytes: int


@dataclass
class _OpenRun:
    name: str
    meta: Mapping[str, Any]
    columns: Mapping[str, tuple[str, ...]]
    blocks: dict[str, list[Array]] = field(default_factory=dict)
    ended: bool = False

    def done(self) -> JournalRun:
        tables = {
            kind: np.concatenate(self.blocks[kind]) if kind in self.blocks else np.empty((0, len(names)))
            for kind, names in self.columns.items()
        }
        return JournalRun(self.name, self.meta, self.columns, tables, self.ended)


def _frames(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, int]]:
    """Sound frames (type, payload, offset of the next), up to the first that is cut or damaged."""
    position = 0
    while size - position >= FRAME_HEAD.size:
        marker, kind, length, crc = FRAME_HEAD.unpack(file.read(FRAME_HEAD.size))
        position += FRAME_HEAD.size
        if marker != MARKER or length > min(MAX_FRAME_BYTES, size - position):
            return
        payload = file.read(length)
        position += length
        if zlib.crc32(payload, zlib.crc32(struct.pack("<BI", kind, length))) != crc:
            return
        yield kind, payload, position


def read_journal(path: str | Path) -> JournalContents:
    """Read a journal as far as it is sound.

    Raises RecordingError where the file is missing or is no journal at all; a cut tail is no error.
    """
    path = Path(path)
    header: dict[str, Any] | None = None
    runs: list[_OpenRun] = []
    events: list[JournalEvent] = []
    closed = False
    good = 0
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            for kind, payload, position in _frames(file, size):
                if header is None and kind != HEADER:
                    break
                if kind == HEADER:
                    header = json.loads(payload)
                elif kind == EVENT:
                    events.append(JournalEvent(**json.loads(payload)))
                else:
                    _add_to_runs(runs, kind, payload)
                closed = kind == CLOSE
                good = position
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}; check the path") from error
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error) as error:
        raise RecordingError(
            f"{path}: the frame at byte {good} is not what this version writes ({error}): "
            "read it with the version that wrote it"
        ) from error
    if not isinstance(header, dict):
        raise RecordingError(f"{path}: not a journal of this program: give the .journal file of a results folder")
    return JournalContents(header, tuple(r.done() for r in runs), tuple(events), closed, size - good)


def _add_to_runs(runs: list[_OpenRun], kind: int, payload: bytes) -> None:
    if kind == RUN:
        head = json.loads(payload)
        columns = {k: tuple(v) for k, v in head["columns"].items()}
        runs.append(_OpenRun(head["name"], head["meta"], columns))
    elif kind == RUN_END:
        runs[-1].ended = True
    elif kind == BLOCK:
        name, width = BLOCK_HEAD.unpack_from(payload)
        table = name.rstrip(b"\0").decode("ascii")
        if width != len(runs[-1].columns[table]):
            raise ValueError(f"{table} has {width} columns, {len(runs[-1].columns[table])} declared")
        rows = np.frombuffer(payload, dtype="<f8", offset=BLOCK_HEAD.size).reshape(-1, width)
        runs[-1].blocks.setdefault(table, []).append(rows.astype(np.float64))


def recording_from_journal(contents: JournalContents) -> Recording:
    """The Recording that a journal holds; runs without a single sample are left out.

    ``info`` is the journal's header and whether every run came to its end.
    """
    runs = tuple(_run(r) for r in contents.runs if len(r.tables["samples"]))
    header = dict(contents.header)
    complete = contents.closed and all(r.ended for r in contents.runs)
    axis, noise = header.get("axis", "rotary"), header.get("noise")
    return Recording(runs, axis=axis, noise=noise, info=header | {"complete": complete})


def _run(source: JournalRun) -> Run:
    samples = {name: source.column("samples", name).copy() for name in source.columns["samples"]}
    time_s = samples.pop("time_s")
    valid = samples.pop("valid", np.ones_like(time_s)) != 0
    rate, angle = samples.pop("rate_rad_s", None), samples.pop("angle_rad", None)
    has_torque = len(source.tables.get("commands", ())) > 0
    meta = {key: source.meta[key] for key in RUN_META if key in source.meta}
    return Run(
        name=source.name,
        time_s=time_s,
        valid=valid,
        rate_rad_s=rate,
        angle_rad=angle,
        torque_time_s=source.column("commands", "time_s").copy() if has_torque else None,
        torque_nm=source.column("commands", "torque_nm").copy() if has_torque else None,
        channels=samples,
        **meta,
    )
