"""The CAN log of a raw capture in the formats of the trade, by python-can: BLF, ASC, and MF4 where asammdf is there."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import can

from drivers.capture.wire_capture import CAN_READ, CAN_SENT, read_capture, unpack_frame
from rig.errors import RecordingError, UsageError


def _mf4_writer(path: str) -> Any:
    """Of python-can, which was imported as if asammdf were not there (see ``drivers``)."""
    return importlib.reload(importlib.import_module("can.io.mf4")).MF4Writer(path)


# Times in these formats begin at the first frame; the host's clock counts from when the machine was switched on.
WRITERS: Mapping[str, Callable[..., Any]] = {"blf": can.BLFWriter, "asc": can.ASCWriter, "mf4": _mf4_writer}


def check_installed(name: str) -> None:
    """Raise UsageError where a format needs a package that is not there."""
    if name == "mf4" and find_spec("asammdf") is None:
        raise UsageError("MF4 needs the package asammdf: pip install 'isp-rig[mf4]', or take --to blf")


def messages_of(capture: Path) -> Iterator[can.Message]:
    """Every frame that crossed the bus, sent and received; its time in s since the first.

    Raises RecordingError where the capture cannot be read.
    """
    first_s: float | None = None
    for entry in read_capture(capture):
        if entry.kind not in (CAN_READ, CAN_SENT):
            continue
        first_s = entry.time_s if first_s is None else first_s
        frame = unpack_frame(entry.payload)
        try:
            yield can.Message(
                timestamp=max(0.0, entry.time_s - first_s), arbitration_id=frame.identifier,
                is_extended_id=frame.extended, is_remote_frame=frame.remote, is_rx=entry.kind == CAN_READ,
                dlc=frame.length if frame.remote else len(frame.data), data=None if frame.remote else frame.data,
                is_fd=frame.fd, channel=0, check=True,
            )  # fmt: skip
        except ValueError as error:
            raise RecordingError(f"{capture}: holds an invalid frame ({error}): the file was changed") from error


def write_can_log(capture: Path, target: Path) -> int:
    """Write the frames of ``capture`` to ``target``, by its suffix; returns how many.

    Raises UsageError where the file exists, RecordingError where the capture holds no frame.
    """
    messages = list(messages_of(capture))
    if not messages:
        raise RecordingError(f"{capture}: holds no CAN frame")
    if target.exists():
        raise UsageError(f"{target} exists and is never overwritten: choose another --out")
    writer = WRITERS[target.suffix[1:]](str(target))
    try:
        for message in messages:
            writer.on_message_received(message)
    finally:
        writer.stop()
    return len(messages)
