"""Summary of a raw capture: what it holds and how much is lost."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from drivers.capture.wire_capture import (
    CAN_READ,
    CAN_SENT,
    GYRO_READ,
    MAGIC,
    RECORD_HEAD_BYTES,
    TICK,
    export,
    read_capture,
)
from rig.recording.tail_file import whole


class CaptureSummary(NamedTuple):
    """Counts of a capture; ``cut_bytes`` at its end belong to no whole record."""

    gyro_bytes: int
    frames: int
    ticks: int
    duration_s: float
    cut_bytes: int

    def __str__(self) -> str:
        text = f"{self.duration_s:.3f} s: {self.gyro_bytes} gyro bytes, {self.frames} CAN frames, {self.ticks} ticks"
        return text + (f"; {self.cut_bytes} byte(s) at its end are cut" if self.cut_bytes else "; not cut")


def summary_of(path: Path) -> CaptureSummary:
    """Read a capture through. Raises RecordingError where it is none."""
    gyro_bytes = frames = ticks = 0
    read = len(MAGIC)
    first_s = last_s = None
    for entry in read_capture(path):
        read += RECORD_HEAD_BYTES + len(entry.payload)
        gyro_bytes += len(entry.payload) if entry.kind == GYRO_READ else 0
        frames += entry.kind in (CAN_READ, CAN_SENT)
        ticks += entry.kind == TICK
        first_s = entry.time_s if first_s is None else first_s
        last_s = entry.time_s
    duration_s = last_s - first_s if first_s is not None and last_s is not None else 0.0
    return CaptureSummary(gyro_bytes, frames, ticks, duration_s, len(whole(path)) - read)


def export_if_missing(path: Path, account: CaptureSummary) -> list[Path]:
    """gyro.bin and can.log of a campaign that was killed before it wrote them; never over a file.

    Raises OSError where the disk is full.
    """
    gyro, log = path.with_name("gyro.bin"), path.with_name("can.log")
    if gyro.exists() and log.exists() and gyro.stat().st_size == account.gyro_bytes:
        return []
    prefix = "recovered_" if gyro.exists() or log.exists() else ""
    if any(path.with_name(f"{prefix}{name}").exists() for name in ("gyro.bin", "can.log")):
        return []
    return list(export(path, prefix))
