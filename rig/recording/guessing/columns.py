"""The columns of a table with what can be seen of each: its numbers, its unit, and the words in its name."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.sentinels import in_words, sentinels, without
from rig.recording.stated_units import stated_unit
from rig.recording.table import SingleNumberError, Table
from rig.units import Unit, name_and_unit, unit_of

MIN_NUMBERS = 10  # numbers that make a column
MAX_CAUSES = 4  # different ones why columns cannot be used
MAX_COLUMNS_IN_REASON = 6  # columns of one reason
LONGEST_SUFFIX = 3  # words of a name that may be its unit: "torque_n_m", "rate_rad_s"
_QUOTED = re.compile(r"'[^']*'")  # what stands in a field
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\dA-Za-z_]+", re.UNICODE)


@dataclass(frozen=True)
class Column:
    """One column as it stands in the file.

    Attributes
    ----------
    words
        Of its name, in small letters, without the unit.
    unit_text
        What the file states as its unit, empty where it states none; ``unit`` is None where that is not known.
    suffix
        A unit that is part of the name: the rad_s of rate_rad_s.
    values
        Shape (n,); None where it cannot be a quantity, for the reason in ``why_not``.
    single
        Its number, where it has but one.
    instead
        Which numbers stood for no reading, in words; they are NaN in ``values``.
    """

    name: str
    words: tuple[str, ...]
    unit_text: str
    unit: Unit | None
    suffix: Unit | None
    values: Array | None
    why_not: str = ""
    single: float | None = None
    instead: str = ""

    @property
    def known_unit(self) -> Unit | None:
        """The unit, stated or in the name."""
        return self.unit or self.suffix

    @property
    def increases(self) -> bool:
        """Whether every number is greater than the one before."""
        return self.values is not None and _increases(self.values)

    @property
    def moves(self) -> bool:
        """Whether not all numbers are the same."""
        return self.values is not None and float(np.nanmax(self.values)) > float(np.nanmin(self.values))


def columns_of(table: Table) -> tuple[Column, ...]:
    """All columns of a table, those that can be a quantity with their values.

    Raises RecordingError where fewer than two can.
    """
    twice = {name for name, count in Counter(table.names).items() if count > 1}
    whole = _read(table, tuple(n for n in table.names if n and n not in twice))
    usual = Counter(len(v) for v in whole.values() if isinstance(v, np.ndarray)).most_common(1)
    length = usual[0][0] if usual else 0
    found = tuple(_column(table, name, whole.get(name, _unread(name)), length) for name in dict.fromkeys(table.names))
    if sum(c.values is not None for c in found) < 2:
        reasons = "; ".join(_reasons(found))
        raise RecordingError(
            f"{table.path}: fewer than two columns of numbers, but a time and a measured channel are needed: "
            f"{reasons or 'export them as columns'}"
        )
    return found


def _reasons(columns: Sequence[Column]) -> list[str]:
    """Why columns cannot be used, what is the same of several but for their names and numbers once, with their names.

    The last of many reasons are left out.
    """
    alike: dict[str, tuple[str, list[str]]] = {}
    for column in columns:
        if not column.why_not:
            continue
        reason = column.why_not.replace(f", column {column.name!r}", "").removeprefix(f"column {column.name!r} ")
        alike.setdefault(_QUOTED.sub("", reason), (reason, []))[1].append(repr(column.name))
    said = []
    for reason, names in list(alike.values())[:MAX_CAUSES]:
        more = [f"{len(names) - MAX_COLUMNS_IN_REASON} more"] if len(names) > MAX_COLUMNS_IN_REASON else []
        by = ":" if len(names) > 1 or reason.startswith("line ") else ""  # 'T' is an object of MATLAB
        said.append(f"{', '.join([*names[:MAX_COLUMNS_IN_REASON], *more])}{by} {reason}")
    return said


def _unread(name: str) -> str:
    return "stands there twice: rename one" if name else "has no name: give it one"


def _read(table: Table, names: tuple[str, ...]) -> dict[str, Array | str]:
    """Values, or what is wrong with a column. All at once where that works: each look at a CSV file takes its time."""
    try:
        return dict(table.read(names))
    except RecordingError:
        pass
    out: dict[str, Array | str] = {}
    for name in names:
        try:
            out[name] = table.read([name])[name]
        except SingleNumberError as error:
            out[name] = np.array([error.value])
        except RecordingError as error:
            out[name] = str(error).removeprefix(f"{table.path}: ")
    return out


def _column(table: Table, name: str, values: Array | str, length: int) -> Column:
    text = stated_unit(table, name)
    plain = name_and_unit(name)[0]
    words = tuple(w.lower() for w in _WORD.findall(plain))
    suffix, count = (None, 0) if text else _suffix(words, plain)
    why_not = values if isinstance(values, str) else _unusable(values, length)
    kept, instead = (None, "") if why_not or isinstance(values, str) else _readings(values)
    single = float(values[0]) if not isinstance(values, str) and len(values) == 1 else None
    unit = unit_of(text) if text else None
    return Column(name, words[: len(words) - count], text, unit, suffix, kept, why_not, single, instead)


def _readings(values: Array) -> tuple[Array, str]:
    """The numbers, NaN where one stands for no reading, and which those are, in words."""
    numbers = {} if _increases(values) else sentinels(values)
    return without(values, numbers), in_words(numbers)


def _increases(values: Array) -> bool:
    return bool(np.all(values[1:] > values[:-1]))


def _unusable(values: Array, length: int) -> str:
    if len(values) != length:
        return f"has {len(values)} values, the others have {length}"
    if np.isfinite(values).sum() < MIN_NUMBERS:
        return f"has {int(np.isfinite(values).sum())} numbers"
    return ""


def _suffix(words: tuple[str, ...], name: str) -> tuple[Unit | None, int]:
    """The unit at the end of a name that has other words before it, as it is written, and how many words it is."""
    for count in range(min(LONGEST_SUFFIX, len(words) - 1), 0, -1):
        tail = words[-count:]
        for text in (" ".join(tail), "/".join(tail), f"{' '.join(tail[:-1])}/{tail[-1]}"):
            unit = unit_of(text)
            if unit is not None and (count > 1 or len(tail[0]) > 1 or unit.dimension == "time"):
                written = unit_of(name[list(_WORD.finditer(name))[-count].start() :])
                return (unit if written is None or written.factor != unit.factor else written), count
    return None, 0
