"""Which recordings of a campaign are too long to be read whole, and the run that each becomes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.checks import check_run
from rig.recording.long.blocks import BLOCK_ROWS, BlockTable, block_table
from rig.recording.long.excerpt import Taken, take
from rig.recording.run import Missing, Run
from rig.recording.stated_units import with_factors_in_place
from rig.recording.table import MAX_SAMPLES
from rig.recording.tables import channels_of, columns_of, factors_of, time_of
from rig.recording.turns import Turns, turns_along

if TYPE_CHECKING:
    from rig.config.recorded import RecordedConfig, RecordedRun

SHORTEST = 2_000  # samples of a run: fewer show no slow effect
CHANNEL = "channel "  # before the name of a further column


@dataclass(frozen=True)
class LongFile:
    """Rows first..last (excluded) of a file, and how many samples they may become."""

    table: BlockTable
    entry: RecordedRun
    section: RecordedConfig
    first: int
    last: int
    most: int

    def run(self) -> Run:
        """The run, checked. Raises RecordingError."""
        path, section, entry = self.table.path, self.section, self.entry
        whole = self.table.rows()
        factors = factors_of(whole, section)
        held = section.torque_hold == "zero_order"

        lost: dict[tuple[int, int], tuple[int, list[str]]] = {}

        def rows(first: int, last: int) -> Mapping[str, Array]:
            table = self.table.rows(first, last)
            channels = channels_of(table, section)
            columns = columns_of(table, factors, section)
            lost[first, last] = _without_a_value(columns, "valid" in factors)
            found = columns | {CHANNEL + name: x for name, x in channels.items()}
            if turns is not None:
                found["angle"] = found["angle"] + turns.added(first, last)
                found["valid"] = np.where(np.isin(np.arange(first, last), turns.passing), 0.0, found["valid"])
            return found

        turns: Turns | None = None
        if section.axis == "rotary" and "angle" in factors:
            turns = turns_along(rows, self.first, self.last, BLOCK_ROWS)
        taken = take(rows, self.first, self.last, self.most, held=held)
        named = Run(
            name=path.name,
            time_s=taken.columns["time"],
            valid=taken.columns["valid"].astype(bool),
            torque_hold=section.torque_hold,
            use=entry.use,
            min_rate_rad_s=section.min_rate_of(entry),
            added_inertia_kg_m2=entry.added_inertia_kg_m2,
            causes={name: config.channel(name) for name, config in section.columns.channels.items()},
        )
        starts = range(self.first, self.last, BLOCK_ROWS)  # as the scan of all rows takes them
        blocks = [lost.get((at, min(at + BLOCK_ROWS, self.last)), (0, [])) for at in starts]
        quantities = dict.fromkeys(q for _, lacking in blocks for q in lacking)
        missing = Missing(within=sum(count for count, _ in blocks), quantities=tuple(quantities))
        run = dataclasses.replace(
            with_columns(named, taken), wraps=0 if turns is None else len(turns.rows),
            missing=missing if missing.told else None,
        )  # fmt: skip
        try:
            return check_run(run, path, section.scales_given, section.axis)
        except RecordingError as error:
            raise RecordingError(with_factors_in_place(str(error), factors)) from None


def long_files(section: RecordedConfig, folder: Path) -> dict[int, LongFile]:
    """The entries that are read in part, by their place in the list; all others are read whole by their readers.

    A fault of a file is left to where it is read.
    """
    spans: dict[int, tuple[BlockTable, int, int]] = {}
    for i, entry in enumerate(section.runs):
        try:
            table = block_table(folder / Path(entry.file).expanduser())
            if table is not None:
                factors_of(table.rows(), section)  # a column of a matrix, which only the whole file has, is no row's
                spans[i] = (table, *_window(table, entry, section))
        except (RecordingError, RuntimeError):
            continue
    total = sum(last - first for _, first, last in spans.values())
    most = section.most_samples
    out: dict[int, LongFile] = {}
    for i, (table, first, last) in spans.items():
        if total > most or table.count > MAX_SAMPLES:
            share = max(SHORTEST, math.floor(most * (last - first) / max(total, most)))
            out[i] = LongFile(table, section.runs[i], section, first, last, share)
    return out


def shortened(runs: Sequence[Run], as_they_are: Collection[int], most: int) -> list[Run]:
    """The runs with about ``most`` samples in all, those ``as_they_are`` besides, by their places."""
    total = sum(len(run.time_s) for i, run in enumerate(runs) if i not in as_they_are)
    if total <= most + most // 100:  # a run that was read in part may have a few samples more than its share
        return list(runs)
    return [run if i in as_they_are else _shorter(run, most, total) for i, run in enumerate(runs)]


def _shorter(run: Run, most: int, total: int) -> Run:
    share = max(SHORTEST, most * len(run.time_s) // total)
    if run.excerpt is not None or len(run.time_s) <= share:
        return run
    columns: dict[str, Array] = {"time": run.time_s, "valid": run.valid.astype(float)}
    columns |= {} if run.rate_rad_s is None else {"rate": run.rate_rad_s}
    columns |= {} if run.angle_rad is None else {"angle": run.angle_rad}
    columns |= {CHANNEL + name: values for name, values in run.channels.items()}
    if run.torque_nm is not None and run.torque_time_s is not None:
        columns["torque"] = np.full(len(run.time_s), np.nan)
        columns["torque"][np.searchsorted(run.time_s, run.torque_time_s)] = run.torque_nm
    taken = take(
        lambda first, last: {name: values[first:last] for name, values in columns.items()},
        0, len(run.time_s), share, held=run.torque_hold == "zero_order",
    )  # fmt: skip
    return with_columns(run, taken)


def with_columns(run: Run, taken: Taken) -> Run:
    """The run with other samples."""
    columns = taken.columns
    torque = columns.get("torque")
    has_torque = None if torque is None else np.isfinite(torque)
    return dataclasses.replace(
        run,
        time_s=columns["time"],
        valid=columns["valid"].astype(bool),
        rate_rad_s=columns.get("rate"),
        angle_rad=columns.get("angle"),
        torque_time_s=None if has_torque is None else columns["time"][has_torque],
        torque_nm=None if torque is None else torque[has_torque],
        torque_hold=run.torque_hold if taken.excerpt.factor == 1 else "band_limited",
        channels={n.removeprefix(CHANNEL): x for n, x in columns.items() if n.startswith(CHANNEL)},
        excerpt=taken.excerpt,
    )


def _without_a_value(columns: Mapping[str, Array], flagged: bool) -> tuple[int, list[str]]:
    """How many rows of a block are lost for want of a value, and of what; none where a column says which are."""
    gone = columns["valid"] == 0.0
    if flagged or not gone.any():
        return 0, []
    return int(np.sum(gone)), [q for q, x in columns.items() if np.any(np.isnan(x[gone]))]


def _window(table: BlockTable, entry: RecordedRun, section: RecordedConfig) -> tuple[int, int]:
    """First row and the row behind the last one between from_s and to_s; the time increases."""
    if entry.from_s is None and entry.to_s is None:
        return 0, table.count
    factors = factors_of(table.rows(), section)

    def time_at(row: int) -> float:
        return float(time_of(table.rows(row, row + 1), factors, section)[0])

    start = -math.inf if entry.from_s is None else entry.from_s
    end = math.inf if entry.to_s is None else entry.to_s
    first = _first_row(time_at, table.count, lambda t: t >= start)
    last = _first_row(time_at, table.count, lambda t: t > end)
    if last - first < 1:
        raise RecordingError(
            f"{table.path}: no sample between from_s = {start:g} and to_s = {end:g}: "
            f"the file runs from {time_at(0):g} to {time_at(table.count - 1):g} s"
        )
    return first, last


def _first_row(time_at: Callable[[int], float], count: int, reached: Callable[[float], bool]) -> int:
    """The first row whose time is ``reached``, by bisection."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if reached(time_at(middle)):
            high = middle
        else:
            low = middle + 1
    return low
