"""Rows of a table in which a needed column has no value: which of them are read, and what becomes of the others.

Channels that begin or end at different times leave such rows at the ends of a table; readings that a device lost leave
them within. A column that has a value in few of its rows was sampled on a beat of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array, Mask
from rig.errors import RecordingError
from rig.recording.run import Missing
from rig.recording.table import Table

WHOLE = 0.5  # of the rows have every value: fewer, and the columns were sampled on beats of their own
MIN_READINGS = 10  # of a column that has a beat
MIN_HOLE_SPACING_RATIO = 3.0  # times the usual spacing of a column's readings: nothing is read between such two
MIN_FOLLOWED_RATE_RATIO = 0.1  # of the fastest column's readings: a slower one is joined, not followed


@dataclass(frozen=True)
class Rows:
    """Some rows of a table.

    Attributes
    ----------
    columns
        Quantity -> values as stored, each of shape (n,); "valid" is 0 in rows that count as lost.
    at
        Shape (n,): where they stand in the table.
    missing
        What was left out; None where nothing was.
    """

    columns: Mapping[str, Array]
    at: NDArray[np.intp]
    missing: Missing | None = None

    def only(self, keep: Mask, missing: Missing | None = None) -> Rows:
        """Some of these rows; ``keep`` has shape (n,)."""
        return Rows({q: x[keep] for q, x in self.columns.items()}, self.at[keep], missing or self.missing)


def with_values(rows: Rows, table: Table) -> Rows:
    """The rows from the first to the last in which every column has a value; those without one within are lost.

    Where a column "valid" says that a row within counts, nothing is decided here, nor where most rows lack a value.

    Raises
    ------
    RecordingError
        Where a column has no value in any row that counts.
    """
    if not len(rows.at):
        return rows
    needed = _there(rows.columns)
    flags = rows.columns.get("valid")
    counts = np.ones(len(rows.at), dtype=bool) if flags is None else flags != 0.0
    for quantity, there in needed.items():
        if counts.any() and not np.any(there & counts):
            raise RecordingError(
                f"{table.path}: {quantity} has no value in any of {len(rows.at)} rows: name another column under "
                f"recorded.columns.{quantity}, or widen from_s and to_s"
            )
    whole = np.all(list(needed.values()), axis=0)
    ends = np.flatnonzero(whole | ~counts)
    first, last = (int(ends[0]), int(ends[-1])) if len(ends) else (0, len(whole) - 1)
    inside = slice(first, last + 1)
    if flags is None and np.mean(whole[inside]) < WHOLE:
        laid = _on_the_slowest(rows, needed)
        return rows if laid is None else with_values(laid, table)
    lost = np.zeros(len(whole), dtype=bool)
    if flags is None:
        lost[inside] = (~whole & needed["time"])[inside]
    left = lost.copy()
    left[:first] = left[last + 1 :] = True
    columns = {q: x[inside] for q, x in rows.columns.items()}
    if lost.any():
        columns["valid"] = np.where(lost[inside], 0.0, 1.0)
    lacking = tuple(q for q, there in needed.items() if np.any(~there & left))
    between = rows.missing.between if rows.missing else ()
    found = Missing(first, len(whole) - last - 1, int(np.sum(lost)), lacking, between)
    return Rows(columns, rows.at[inside], found if found.told else None)


def lost_within(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns of rows that are read in blocks, with "valid" 0 where one has no value and nothing else says so."""
    if "valid" in columns:
        return dict(columns)
    needed = _there(columns)
    lost = ~np.all(list(needed.values()), axis=0) & needed["time"]
    return {**columns, "valid": np.where(lost, 0.0, 1.0)} if lost.any() else dict(columns)


def read_between(time_s: Array, values: Array, at_s: Array) -> Array:
    """Readings at other times by straight lines, shape (m,); NaN outside of them and in holes between them.

    Parameters
    ----------
    time_s, values
        Shape (n,), the times increasing; NaN where there is no reading.
    at_s
        Shape (m,).
    """
    there = np.isfinite(time_s) & np.isfinite(values)
    own_s, own = time_s[there], values[there]
    if len(own) < MIN_READINGS:
        return np.full(len(at_s), np.nan)
    spacing = np.diff(own_s)
    behind = np.clip(np.searchsorted(own_s, at_s, side="right"), 1, len(own) - 1)
    hole = (
        (spacing[behind - 1] > MIN_HOLE_SPACING_RATIO * np.median(spacing))
        & (own_s[behind - 1] < at_s)
        & (at_s < own_s[behind])
    )
    found: Array = np.interp(at_s, own_s, own, left=np.nan, right=np.nan)
    return np.where(hole, np.nan, found)


def _there(columns: Mapping[str, Array]) -> dict[str, Mask]:
    """Which rows have a value, by quantity; an infinite one is there, and a fault."""
    return {q: ~np.isnan(x) for q, x in columns.items() if q != "valid"}


def _on_the_slowest(rows: Rows, needed: Mapping[str, Mask]) -> Rows | None:
    """Columns that stand in rows of their own, at the rows of the slowest; None where that is not what is missing.

    The slowest is that of the columns at least a tenth as fast as the fastest; the others are read between their own
    rows by straight lines, as those of a file with several rates are.
    """
    time = rows.columns["time"]
    own = {q: np.flatnonzero(there & needed["time"]) for q, there in needed.items() if q != "time"}
    counts = {q: len(at) for q, at in own.items()}
    if min(counts.values()) < MIN_READINGS or not np.all(np.diff(time[needed["time"]]) > 0.0):
        return None
    base = min((n, q) for q, n in counts.items() if n >= MIN_FOLLOWED_RATE_RATIO * max(counts.values()))[1]
    at = own[base]
    columns = {
        q: x[at] if q in ("time", base) else read_between(time, x, time[at]) for q, x in rows.columns.items()
    }  # fmt: skip
    between = tuple(q for q in own if q != base and not np.all(needed[q][at]))
    return Rows(columns, rows.at[at], Missing(between=between))
