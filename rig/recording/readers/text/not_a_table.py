"""Text that is no table below a header: labels beside the data, or one value a row with the name of its quantity."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from rig.arrays import Array
from rig.recording.readers.text.line_fields import is_reading
from rig.recording.readers.text.timestamps import is_stamp
from rig.recording.readers.text.words import NO_READING, is_number
from rig.recording.readers.text.words import number as number_of

MIN_LABELS = 3  # different ones beside the data
MOST_QUANTITIES = 40  # names that take turns; more are comments
MIN_TURNS = 3  # rows a name, where names take turns
SIDE_HEADER = (
    "has its header beside the data: keep the two columns of numbers of each channel, its time and its values, and put "
    "a line of names above, e.g. time_s,torque_nm,rate_rad_s"
)

Rows = Sequence[Sequence[str]]


def beside_data(rows: Rows) -> list[tuple[int, list[int]]]:
    """Where labels stand beside the data from the first row on: per channel their column, and those of its numbers.

    A label has a value behind it; both columns are empty once the labels end, while the numbers go on. The labels of a
    further channel are the same ones. Nothing of this in all other files.
    """
    if len(rows[0]) < 4 or len({len(row) for row in rows}) != 1 or not rows[0][1] or rows[-1][0] or rows[-1][1]:
        return []
    columns = [list(column) for column in zip(*rows, strict=True)]
    labels = [label for label in columns[0] if label]
    if not columns[0][0] or len({*labels}) < max(MIN_LABELS, len(labels)) or any(map(is_reading, labels)):
        return []
    begins = [i for i, column in enumerate(columns) if column == columns[0]]
    numbers = [i for i, column in enumerate(columns) if all(map(is_number, column))]
    ends = [*begins[1:], len(columns)]
    blocks = [(at, [i for i in numbers if at < i < end]) for at, end in zip(begins, ends, strict=True)]
    return blocks if all(len(data) >= 2 for _, data in blocks) else []


def one_value_a_row(names: Sequence[str], rows: Rows) -> str:
    """What is wrong with a file that has one value a row, and the cure; empty for all others.

    A column of a few words that take turns, a time, and one column of numbers that neither only rise nor are constant.
    """
    whole = [row[: len(names)] for row in rows if len(row) >= len(names)]
    columns = dict(zip(names, zip(*whole, strict=True), strict=False))
    named = next((name for name, column in columns.items() if _take_turns(column)), None)
    if named is None:
        return ""
    numbers = {n: _numbers(c) for n, c in columns.items() if all(map(is_number, c))}
    rising = [n for n, x in numbers.items() if np.all(np.diff(x) >= 0.0) and x[0] < x[-1]]
    times = [n for n, c in columns.items() if all(map(is_stamp, c))] + rising
    values = [n for n, x in numbers.items() if np.ptp(x) > 0.0 and n not in rising]
    if not times or len(values) != 1:
        return ""
    pivot = f"pivot_table(index={times[0]!r}, columns={named!r}, values={values[0]!r})"
    return (
        f"has one value a row, {named!r} says of which quantity: make it one column a quantity (pivot {named!r} "
        f"against the time), for example with pandas: {pivot}"
    )


def _take_turns(column: Sequence[str]) -> bool:
    """Whether these are a few words, of which another one follows in most rows."""
    words = {*column}
    if not 2 <= len(words) <= min(MOST_QUANTITIES, len(column) // MIN_TURNS):
        return False
    if any(word.lower() in NO_READING or is_reading(word) for word in words):
        return False
    return sum(a != b for a, b in pairwise(column)) > len(column) // 2


def _numbers(column: Sequence[str]) -> Array:
    comma = any("," in field for field in column)
    return np.array([number_of(field, comma) for field in column])
