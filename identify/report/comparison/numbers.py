"""Two numbers side by side, and whether they differ by more than both intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

from identify.report.comparison.saved import SavedNumber
from identify.results import NORMAL_95, ParameterEstimate
from identify.wording import half_interval, number, percent, readable, signed, unit, value_of, with_interval

ABSENT = "-"
IN_MS_BELOW_S = 0.1  # as for a single number: ``readable``; here a zero beside it is in ms too


@dataclass(frozen=True)
class Change:
    """One line of a comparison in words.

    Attributes
    ----------
    a, b
        The numbers with their 95 % intervals.
    difference, relative
        B - A in ``unit``, and in percent of A.
    is_larger
        Whether it is larger than both intervals: "yes", "no", or why that cannot be said.
    """

    a: str
    b: str
    difference: str
    relative: str
    is_larger: str
    unit: str


def is_beyond_both(a: SavedNumber, b: SavedNumber) -> bool:
    """Whether the 95 % intervals have no point in common. Both have to have one; an open end reaches everywhere."""
    (a_low, a_high), (b_low, b_high) = a.estimate().ci95, b.estimate().ci95
    return a_low > b_high or b_low > a_high


def change_of(a: SavedNumber, b: SavedNumber) -> Change:
    """Two numbers of the same name."""
    if a.unit != b.unit:
        return Change(_alone(a, True), _alone(b, True), ABSENT, ABSENT, "other unit", "")
    first, last = a.estimate(), b.estimate()
    if first.unit == "s" and max(abs(first.value), abs(last.value)) < IN_MS_BELOW_S:
        first, last = _in_ms(first), _in_ms(last)
    difference = last.value - first.value
    if math.isnan(difference):
        relation = "no value"
    elif not (a.has_interval and b.has_interval):
        relation = "no interval"
    else:
        relation = "yes" if is_beyond_both(a, b) else "no"
    shown = ABSENT if math.isnan(difference) else _difference(first, last)
    is_shown = shown != ABSENT and float(shown) != 0.0
    relative = 100.0 * difference * is_shown / abs(first.value) if first.value else math.nan
    return Change(_text(a, first), _text(b, last), shown, percent(relative), relation, unit(first.unit))


def _difference(first: ParameterEstimate, last: ParameterEstimate) -> str:
    """B - A, with as many digits as the wider interval of the two supports; three where neither has one."""
    value = last.value - first.value
    half = max((x for x in map(half_interval, (first, last)) if math.isfinite(x)), default=0.0)
    if half <= 0.0 or not value:
        return signed(value, 3)
    shown = value_of(ParameterEstimate(value, half / NORMAL_95, (value - half, value + half), first.unit))
    if not float(shown):
        return shown.removeprefix("-")
    return f"+{shown}" if value > 0.0 else shown


def one_sided(a: SavedNumber | None, b: SavedNumber | None, absent: str, relation: str) -> Change:
    """A number that only one of the two has; ``absent`` says why the other has none."""
    given = a or b
    assert given is not None
    first, last = (absent if one is None else _alone(one) for one in (a, b))
    return Change(first, last, ABSENT, ABSENT, relation, unit(readable(given.estimate()).unit))


def _in_ms(one: ParameterEstimate) -> ParameterEstimate:
    low, high = one.ci95
    return ParameterEstimate(1e3 * one.value, 1e3 * one.std_error, (1e3 * low, 1e3 * high), "ms")


def factor(a: float | None, b: float | None) -> str:
    """B over A, where both are there."""
    if a is None or b is None or not a or not math.isfinite(b / a):
        return ABSENT
    return number(b / a, 3)


def _alone(one: SavedNumber, with_unit: bool = False) -> str:
    shown = readable(one.estimate())
    return f"{_text(one, shown)} {unit(shown.unit)}" if with_unit else _text(one, shown)


def _text(one: SavedNumber, shown: ParameterEstimate) -> str:
    return with_interval(shown) if one.has_interval else number(shown.value)
