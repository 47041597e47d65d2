"""A file without a time: how often its rows were taken, as a number in the file or somebody says."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from rig.recording.guessing.columns import Column
from rig.recording.guessing.roles import COUNTERS
from rig.units import Unit

# What programs call a single number beside the columns: samples a second, and seconds a sample.
_RATES = frozenset({"fs", "fsamp", "fsample", "samplerate", "samplingrate", "samplefreq", "samplingfrequency", "srate"})
_STEPS = frozenset({"dt", "ts", "tsample", "sampletime", "samplingtime", "sampleinterval", "deltat"})


def stated_rate(columns: Sequence[Column]) -> tuple[str, float] | None:
    """Name and samples a second, in Hz, of a single number that says so; None where none does."""
    for column in columns:
        if column.single is None or not 0.0 < column.single < np.inf:
            continue
        plain = re.sub(r"_s$|_?hz$|[\W_]", "", column.name.rpartition(".")[2].lower())
        if plain in _RATES:
            return column.name, column.single
        if plain in _STEPS:
            return column.name, 1.0 / column.single
    return None


def sample_counter(columns: Sequence[Column]) -> Column | None:
    """A column that counts the rows, also those that are missing; None where there is none."""
    return next((c for c in columns if set(c.words) & COUNTERS and c.increases and _is_whole(c)), None)


def even_time(columns: Sequence[Column], rate_hz: float) -> Column:
    """Times in s for rows at even distances: a column that the file does not have."""
    count = max(len(c.values) for c in columns if c.values is not None)
    return Column("", (), "s", Unit("s", "time", 1.0), None, np.arange(count) / rate_hz)


def _is_whole(column: Column) -> bool:
    return column.values is not None and bool(np.all(column.values == np.rint(column.values)))
