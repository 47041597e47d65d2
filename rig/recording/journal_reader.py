"""Reading a journal back, whole, cut off by a kill or damaged, and making a Recording of it.

A frame that is cut or damaged costs itself and, of its run, what comes after it: torque is held from one command to
the next, so a hole in the middle of a run would put torque where there was none. The runs behind it are read on.
"""

from __future__ import annotations

import json
import math
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from rig.arrays import Array
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
from rig.recording.retiming import BEGUN_S, NO_RETIMING, Retiming, retimed, retiming_from_event
from rig.recording.rows import increasing, on_samples
from rig.recording.run import Recording, Run, printable
from rig.recording.tail_file import opened

RUN_META = (
    "torque_hold", "use", "min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "rate_corner_hz", "rate_delay_s",
)  # fmt: skip


@dataclass(frozen=True)
class JournalRun:
    """One run as written: ``tables`` maps a kind to its rows, shape (n, columns).

    ``ended`` is False where the writer was killed in it, ``complete`` only True where it was played to its end.
    ``retiming_of`` are what became known of its times afterwards; the tables are as they were written.
    """

    name: str
    meta: Mapping[str, Any]
    columns: Mapping[str, tuple[str, ...]]
    tables: Mapping[str, Array]
    ended: bool
    complete: bool = False
    retiming_of: Retiming = NO_RETIMING

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

    ``closed`` is False where the writer was killed; ``unread_bytes`` counts what belongs to no sound frame: the tail
    that was cut off, and ``gaps`` damaged stretches before the last sound frame. ``stray_rows`` were sound, but stand
    behind a damaged stretch, so that it is not known to which run they belong.
    """

    header: Mapping[str, Any]
    runs: tuple[JournalRun, ...]
    events: tuple[JournalEvent, ...]
    closed: bool
    unread_bytes: int
    gaps: int = 0
    stray_rows: int = 0


@dataclass
class _OpenRun:
    name: str
    meta: Mapping[str, Any]
    columns: Mapping[str, tuple[str, ...]]
    blocks: dict[str, list[Array]] = field(default_factory=dict)
    ended: bool = False
    complete: bool = False

    def done(self, better: Mapping[float, Retiming]) -> JournalRun:
        tables = {
            kind: np.concatenate(self.blocks[kind]) if kind in self.blocks else np.empty((0, len(names)))
            for kind, names in self.columns.items()
        }
        begun_s = self.meta.get(BEGUN_S)
        known = better.get(begun_s, NO_RETIMING) if isinstance(begun_s, float) else NO_RETIMING
        return JournalRun(self.name, self.meta, self.columns, tables, self.ended, self.complete, known)


def _frames(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, int, int]]:
    """Sound frames (type, payload, offset, offset of the next), over damaged stretches to the last."""
    position = 0
    worth_trying = 4 * size + MAX_FRAME_BYTES  # bytes: a file made of heads that lie must not take for ever
    while size - position >= FRAME_HEAD.size:
        file.seek(position)
        marker, kind, length, crc = FRAME_HEAD.unpack(file.read(FRAME_HEAD.size))
        start, end = position, position + FRAME_HEAD.size + length
        if marker == MARKER and length <= MAX_FRAME_BYTES and end <= size:
            payload = file.read(length)
            worth_trying -= length
            if zlib.crc32(payload, zlib.crc32(struct.pack("<BI", kind, length))) == crc:
                yield kind, payload, start, end
                position = end
                continue
        found = _next_marker(file, start + 1, size)
        if found is None or worth_trying < 0:
            return
        position = found


def _next_marker(file: BinaryIO, start: int, size: int) -> int | None:
    """Where the next frame may begin."""
    step = 1 << 20
    for at in range(start, size, step):
        file.seek(at)
        found = file.read(step + len(MARKER) - 1).find(MARKER)
        if found >= 0:
            return at + found
    return None


class _Reading:
    """What the frames said so far."""

    def __init__(self) -> None:
        self.header: dict[str, Any] | None = None
        self.runs: list[_OpenRun] = []
        self.events: list[JournalEvent] = []
        self.closed = False
        self.good_bytes = self.end = self.gaps = self.stray_rows = 0
        self._open: _OpenRun | None = None

    def take(self, kind: int, payload: bytes, start: int, end: int) -> None:
        """One sound frame."""
        if start > self.end:
            self.gaps += 1
            self._open = None
        if kind == HEADER:
            self.header = json.loads(payload)
        elif kind == EVENT:
            self.events.append(JournalEvent(**json.loads(payload)))
        elif kind == RUN:
            self._begin(json.loads(payload))
        elif kind == RUN_END:
            self._end(payload)
        elif kind == BLOCK:
            self._add(payload)
        self.closed = kind == CLOSE
        self.good_bytes += end - start
        self.end = end

    def _begin(self, head: dict[str, Any]) -> None:
        columns = {str(k): tuple(printable(str(name)) for name in v) for k, v in head["columns"].items()}
        if "time_s" not in columns["samples"]:
            raise ValueError("a run without time_s among its samples")
        self._open = _OpenRun(printable(str(head["name"])), dict(head["meta"]), columns)
        self.runs.append(self._open)

    def _end(self, payload: bytes) -> None:
        if self._open is not None:
            self._open.ended = True
            self._open.complete = bool(payload) and json.loads(payload).get("complete") is True
        self._open = None

    def _add(self, payload: bytes) -> None:
        name, width = BLOCK_HEAD.unpack_from(payload)
        rows = np.frombuffer(payload, dtype="<f8", offset=BLOCK_HEAD.size).reshape(-1, width)
        if self._open is None:
            self.stray_rows += len(rows)
            return
        table = name.rstrip(b"\0").decode("ascii")
        if width != len(self._open.columns[table]):
            raise ValueError(f"{table} has {width} columns, {len(self._open.columns[table])} declared")
        self._open.blocks.setdefault(table, []).append(rows.astype(np.float64))


def read_journal(path: str | Path) -> JournalContents:
    """Read a journal as far as it is sound.

    Raises RecordingError where the file is missing or is no journal at all; a cut tail is no error.
    """
    path = Path(path)
    reading = _Reading()
    try:
        with opened(path) as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(0)
            is_one = file.read(len(MARKER)) == MARKER
            for found in _frames(file, size) if is_one else ():
                reading.take(*found)
        better = dict(each for event in reading.events if (each := retiming_from_event(event.values)) is not None)
        runs = tuple(run.done(better) for run in reading.runs)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}; check the path") from error
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error) as error:
        raise RecordingError(
            f"{path}: the frame at byte {reading.end} is not in the format of this version ({error}): "
            "read it with the version that wrote it"
        ) from error
    if not isinstance(reading.header, dict) and not runs:
        raise RecordingError(f"{path}: not a journal of this program: give the .journal file of a results folder")
    return JournalContents(
        reading.header if isinstance(reading.header, dict) else {}, runs, tuple(reading.events), reading.closed,
        size - reading.good_bytes, reading.gaps, reading.stray_rows,
    )  # fmt: skip


def recording_from_journal(contents: JournalContents) -> Recording:
    """The Recording that a journal holds; runs without a single sample are left out.

    ``info`` is the journal's header and whether every run came to its end.
    """
    runs = tuple(run_from_journal(r) for r in contents.runs if len(r.tables["samples"]))
    header = dict(contents.header)
    complete = contents.closed and all(r.ended for r in contents.runs)
    axis: Literal["rotary", "linear"] = "linear" if header.get("axis") == "linear" else "rotary"
    noise = header.get("noise")
    known = isinstance(noise, (int, float)) and math.isfinite(noise) and noise > 0
    return Recording(runs, axis=axis, noise=noise if known else None, info=header | {"complete": complete})


def run_from_journal(source: JournalRun) -> Run:
    """One run as the recorder would have made it: rows in order of time, slow channels on the samples' grid.

    Raises ValueError, TypeError or KeyError where the frames are sound but hold something else.
    """
    rows = increasing(source.tables["samples"])
    samples = {name: rows[:, i].copy() for i, name in enumerate(source.columns["samples"])}
    time_s = retimed(samples.pop("time_s"), source.retiming_of.samples)
    valid = samples.pop("valid", np.ones_like(time_s)) != 0
    rate, angle = samples.pop("rate_rad_s", None), samples.pop("angle_rad", None)
    commands = increasing(source.tables["commands"]) if "commands" in source.tables else np.empty((0, 2))
    names = list(source.columns.get("commands", ()))
    ticks = source.tables.get("ticks", np.empty((0, 2)))
    if len(ticks):
        samples |= on_samples(ticks, source.columns["ticks"][2:], 2, time_s)
    return Run(
        name=source.name,
        time_s=time_s,
        valid=valid,
        rate_rad_s=rate,
        angle_rad=angle,
        torque_time_s=retimed(commands[:, names.index("time_s")].copy(), source.retiming_of.torque)
        if len(commands)
        else None,
        torque_nm=commands[:, names.index("torque_nm")].copy() if len(commands) else None,
        channels=samples,
        **{key: _checked(key, source.meta[key]) for key in RUN_META if source.meta.get(key) is not None},
    )


def _checked(key: str, value: Any) -> Any:
    """A value of a run's meta, of the type that a Run wants. Raises ValueError or TypeError."""
    if key in ("torque_hold", "use"):
        return str(value)
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{key} is {value!r}")
    return number
