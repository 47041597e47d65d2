"""Headings that say by a word in each line what the line is: those of TwinCAT, ControlDesk, Yokogawa, Rigol, LabVIEW,
Tektronix.

Nobody could find the names of the columns in them by their place above the data alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from rig.recording.readers.text.not_a_table import beside_data
from rig.recording.readers.text.words import EMPTY

SEARCHED = 60  # lines in which a heading has to be known
COUNTED = "time_s"  # the column of times that follow from the heading
_NO_UNIT = EMPTY | {"(none)"}
_BEHIND_UNIT = re.compile(r"\s*\([^()]*\)$")  # "Nm (Torque)"

Lines = Sequence[tuple[int, str]]


@dataclass(frozen=True)
class Heading:
    """What a heading says.

    Attributes
    ----------
    at
        Of the lines that were given, the first that is data.
    counted
        First time and step in s, where the rows have no time of their own.
    pairs
        The columns of time and channel, where each channel has a time before it.
    """

    delimiter: str
    names: tuple[str, ...]
    units: Mapping[str, str]
    at: int
    counted: tuple[float, float] | None = None
    pairs: tuple[tuple[str, str], ...] = ()


@dataclass
class _Rows:
    """The first lines, split, by their first field in small letters."""

    delimiter: str
    rows: list[list[str]] = field(default_factory=list)

    def find(self, word: str) -> int | None:
        """The first line that begins with the word."""
        return next((i for i, row in enumerate(self.rows) if row[0].lower() == word), None)

    def of(self, word: str) -> list[str]:
        """The fields behind the word; none where no line begins with it."""
        at = self.find(word)
        return [] if at is None else self.rows[at][1:]


def known_heading(lines: Lines, split: Callable[[str, str], list[str]]) -> Heading | None:
    """The heading of a tool that is known; None for all other files. ``lines``: number and text, none empty."""
    for delimiter in ("\t", ";", ","):
        rows = _Rows(delimiter, [split(text, delimiter) or [""] for _, text in lines[:SEARCHED]])
        for tool in (_twincat, _control_desk, _yokogawa, _rigol, _labview, _tektronix):
            heading = tool(rows)
            if heading is not None:
                return heading
    return None


def _twincat(rows: _Rows) -> Heading | None:
    """TwinCAT's scope: a time in ms before each channel, and above the two "Name", "Unit" and so on with its value."""
    at = rows.find("data-type")
    begin = None if at is None else next((i for i in range(at, -1, -1) if rows.rows[i][0] == "Name"), None)
    if at is None or begin is None or len(rows.rows[begin]) < 2:
        return None
    named = rows.rows[begin][1::2]
    end = next((i for i in range(begin, len(rows.rows)) if _is_float(rows.rows[i][0])), len(rows.rows))
    stated = next((rows.rows[i][1::2] for i in range(begin, end) if rows.rows[i][0] == "Unit"), [])
    names = [name for channel in named for name in (f"{channel} time", channel)]
    units = {f"{channel} time": "ms" for channel in named}
    for channel, unit in zip(named, stated, strict=False):
        if unit.lower() not in _NO_UNIT:
            units[channel] = _BEHIND_UNIT.sub("", unit)
    pairs = tuple((f"{channel} time", channel) for channel in named)
    return Heading(rows.delimiter, tuple(names), units, end, pairs=pairs) if end < len(rows.rows) else None


def _control_desk(rows: _Rows) -> Heading | None:
    """dSPACE's ControlDesk: trace_names, unit, and trace_values before the first row; then that column is empty."""
    names, at = rows.of("trace_names"), rows.find("trace_values")
    if not names or at is None:
        return None
    at += len(rows.rows[at]) < 2 or not any(rows.rows[at][1:])  # the word in a line of its own
    units = next((found for word in ("unit", "units", "trace_units") if (found := rows.of(word))), [])
    return Heading(rows.delimiter, ("", *names), _stated(names, units), at)


def _yokogawa(rows: _Rows) -> Heading | None:
    """Yokogawa's recorders: TraceName, VUnit and SampleRate; the rows begin with an empty field."""
    names, rates, last = rows.of("tracename"), rows.of("samplerate"), rows.find("hoffset")
    if not names or last is None:
        return None
    begin = _float(next(iter(rows.of("hoffset")), ""))
    rate_hz = _float(next(iter(rates), ""))
    behind = range(last + 1, len(rows.rows))  # more lines with a word, Date and Time among them, before the rows
    at = next((i for i in behind if not rows.rows[i][0] and any(_is_float(f) for f in rows.rows[i])), None)
    if at is None or not rate_hz or len({*map(_float, rates)} - {None}) > 1:
        return None
    return Heading(rows.delimiter, ("", *names), _stated(names, rows.of("vunit")), at, (begin or 0.0, 1.0 / rate_hz))


def _rigol(rows: _Rows) -> Heading | None:
    """Rigol's oscilloscopes: behind the channels a first time and a step, both once in the row below the names."""
    if len(rows.rows) < 3 or rows.rows[1][0] != "Sequence":
        return None
    names = [name.lower() for name in rows.rows[0]]
    if "start" not in names or "increment" not in names:
        return None
    said = dict(zip(names, rows.rows[1], strict=False))
    begin, step = _float(said.get("start", "")), _float(said.get("increment", ""))
    width = names.index("start")
    if begin is None or not step:
        return None
    channels = rows.rows[0][1:width]  # before them the rows are counted
    return Heading(rows.delimiter, ("", *channels), _stated(channels, rows.rows[1][1:width]), 2, (begin, step))


def _labview(rows: _Rows) -> Heading | None:
    """LabVIEW's measurement file without a time, or with a time before each channel."""
    kind = next(iter(rows.of("x_columns")), "").lower()
    if rows.rows[0][0] != "LabVIEW Measurement" or kind not in ("no", "multi"):
        return None
    ends = [i for i, row in enumerate(rows.rows) if row[0].startswith("***End_of_Header***")]
    if len(ends) < 2 or len(rows.rows) < ends[1] + 3:
        return None
    names = [name for name in rows.rows[ends[1] + 1] if name.lower() != "comment"]
    units = [u for u in rows.of("y_unit_label") if u]
    if kind == "no":
        step, begin = (_float(next(iter(rows.of(word)), "")) for word in ("delta_x", "x0"))
        if not step:
            return None
        names = ["", *names[1:]] if not names[0] or names[0] == "X_Value" else names
        return Heading(rows.delimiter, tuple(names), _stated(names[1:], units), ends[1] + 2, (begin or 0.0, step))
    pairs = tuple((f"{name} time (s)", name) for name in names[1::2])
    columns = tuple(name for pair in pairs for name in pair)
    return Heading(rows.delimiter, columns, _stated(names[1::2], units), ends[1] + 2, pairs=pairs)


def _tektronix(rows: _Rows) -> Heading | None:
    """Tektronix' oscilloscopes: labels and their values beside the first rows, then a time and a channel; side by side
    for more channels."""
    blocks = beside_data(rows.rows)
    names = [""] * len(rows.rows[0])
    units, pairs = dict[str, str](), list[tuple[str, str]]()
    for label, data in blocks:
        said = {row[label].lower(): row[label + 1] for row in rows.rows}
        channel = said.get("source", "")
        if not channel or len(data) != 2 or channel in names:
            return None
        pair = (f"{channel} time", channel)
        names[data[0]], names[data[1]] = pair
        units |= _stated(pair, [said.get("horizontal units", ""), said.get("vertical units", "")])
        pairs.append(pair)
    return Heading(rows.delimiter, tuple(names), units, 0, pairs=tuple(pairs)) if blocks else None


def _stated(names: Sequence[str], units: Sequence[str]) -> dict[str, str]:
    return {name: unit for name, unit in zip(names, units, strict=False) if name and unit.lower() not in _NO_UNIT}


def _float(text: str) -> float | None:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def _is_float(text: str) -> bool:
    return _float(text) is not None
