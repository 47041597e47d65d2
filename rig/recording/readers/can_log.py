"""Logs of CAN frames: they have no signals before a DBC file decodes them, and are told and not read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError

SUFFIXES = (".blf",)
_LINES = 5  # in which such a log shows
_DATE = re.compile(r"date\s+\w{3}\s")  # Vector's .asc: date Mon May 6 02:03:07.000 pm 2024, then base hex ...
_BASE = re.compile(r"base\s+(hex|dec)\b")
_CANDUMP = re.compile(r"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#")  # (22446.621534) can0 601#40001000


def is_can_log(lines: Sequence[str]) -> bool:
    """Whether a text file is a log of frames, by its first lines."""
    first = [line.strip() for line in lines[:_LINES]]
    is_vectors = any(_DATE.match(line) for line in first) and any(_BASE.match(line) for line in first)
    return is_vectors or (bool(first) and all(_CANDUMP.match(line) for line in first))


def undecoded(path: Path, how: str = "") -> RecordingError:
    """What is raised for a log of frames; ``how``: with which program it is decoded."""
    how = how or "CANalyzer and CANape export the signals, cantools decodes in Python"
    return RecordingError(
        f"{path}: holds raw CAN frames and no signals: decode it with the DBC file first ({how}), then read the "
        "decoded file"
    )
