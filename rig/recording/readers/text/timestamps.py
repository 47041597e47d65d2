"""Times of day, dates and durations as loggers write them, as seconds."""

from __future__ import annotations

import math
import re
from datetime import date

MIN_STEPS_BEFORE = 3  # steps from stamp to stamp before one can say what is the day
LONGEST_EVEN_STEP = 2.0  # times the longest step before, which a clock that goes on may need
_DAY_S = 86_400.0
_HOUR_S = 3_600.0
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
# A day, in the orders that are told apart: 2024-12-31 or 2024/12/31, 31.12.2024, 31-Dec-2024; and one that is not.
_YEAR_FIRST = re.compile(r"(\d{4})([-/])(\d{1,2})\2(\d{1,2})$")
_COMPACT = re.compile(r"(\d{4})(\d{2})(\d{2})$")
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})$")
_MONTH_BY_NAME = re.compile(r"(\d{1,2})-([A-Za-z]{3})-(\d{4})$")
_SLASHES = re.compile(r"(\d{1,2})/(\d{1,2})/(\d{4})$")
# A duration with its unit, as MATLAB writes those of a timetable: 0.002 sec.
_WITH_UNIT = re.compile(r"([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?) (sec|s|ms|min|hr|h|days|day|d)$")
_UNIT_S = {"sec": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "hr": _HOUR_S, "h": _HOUR_S, "d": _DAY_S}
_UNIT_S |= {"day": _DAY_S, "days": _DAY_S}
_DAYS = re.compile(r"(\d+) days?,?$")  # of a duration
_FRACTION = r"(?:[.,](\d+))?"
_CLOCK = re.compile(rf"(\d{{1,4}}):(\d{{2}})(?::(\d{{2}}){_FRACTION})?$")
_COLON_MS = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}):(\d{3})$")
_COMPACT_CLOCK = re.compile(rf"(\d{{2}})(\d{{2}})(\d{{2}}){_FRACTION}$")
_MINUTES = re.compile(r"(\d{1,2}):(\d{2})[.,](\d+)$")  # minutes, seconds and a fraction, as Excel shows times
_HALF_OF_DAY = re.compile(r"\s*([AaPp])\.?[Mm]\.?$")
_ZONE = re.compile(r"\s*(Z|UTC|[+-]\d{2}(?::?\d{2})?)$")
_PARTED = re.compile(r"(\d+ days?,?|[^\s:]{8,11}?)(?:\s+|(?<=\d)T(?=\d))(\S.*)$")


class AmbiguousDateError(ValueError):
    """A date of which nobody knows what is the day and what is the month, where that matters."""


class Stamps:
    """Turns the stamps of one column, in their order, into seconds since the first one's midnight.

    Since midnight and not since 1970: a float has 4e-12 s of room left there. A clock without a date that falls by
    more than half of its round (a day; an hour where it shows minutes) has gone round. Between 05/06/2024 and
    06/06/2024 it matters what is the day: the one of the two that is above twelve says it for the whole column, or
    the steps before, where the clock goes on in such a step only if one of the two is the day.
    """

    def __init__(self) -> None:
        self._first_day: str | None = None
        self._day = ("", 0.0)  # the last one, and what it adds
        self._zone_s: float | None = None
        self._before = 0.0
        self._rounds_s = 0.0
        self._order = ""  # of day and month, once it is known
        self._last_s = math.nan  # the stamp before, with its date
        self._longest_s = 0.0  # of the steps before
        self._steps = 0

    def seconds(self, text: str) -> float:
        """Seconds of one stamp. Raises ValueError where the text is none, AmbiguousDateError for such a date."""
        text = text.strip().removeprefix("[").removesuffix("]")
        if found := _WITH_UNIT.match(text):
            return float(found[1].replace(",", ".")) * _UNIT_S[found[2]]
        day, clock = _parted(text)
        if not day:
            now, round_s = _of_clock(clock)
            now += self._rounds_s
            if now < self._before - round_s / 2.0:
                self._rounds_s += round_s
                now += round_s
            self._before = now
            return now
        if found := _DAYS.match(day):
            return _DAY_S * int(found[1]) + _of_clock(clock)[0]
        clock, zone_s = _without_zone(clock)
        if self._first_day is None:
            self._first_day, self._zone_s = day, zone_s
            _check_day(day)
        now, round_s = _of_clock(clock)
        if round_s != _DAY_S or now >= _DAY_S or (zone_s is None) != (self._zone_s is None):
            raise ValueError(text)
        now -= (zone_s or 0.0) - (self._zone_s or 0.0)
        if day != self._day[0]:
            self._day = (day, self._of_day(day, now))
        now += self._day[1]
        if not math.isnan(self._last_s):
            self._longest_s, self._steps = max(self._longest_s, now - self._last_s), self._steps + 1
        self._last_s = now
        return now

    def _of_day(self, day: str, now: float) -> float:
        """Seconds between the first day and another one. Raises ValueError, AmbiguousDateError where both could be."""
        assert self._first_day is not None
        days = _days_between(self._first_day, day)
        if self._order in days:
            days = {self._order: days[self._order]}
        elif len(days) > 1 and self._steps >= MIN_STEPS_BEFORE:
            most = LONGEST_EVEN_STEP * self._longest_s
            goes_on = {o: n for o, n in days.items() if 0.0 < now + _DAY_S * n - self._last_s <= most}
            days = goes_on if len(goes_on) == 1 else days
        if len(days) != 1:
            raise AmbiguousDateError(day)
        self._order, count = next(iter(days.items()))
        return _DAY_S * count


def _parted(text: str) -> tuple[str, str]:
    """Day (empty for none) and time of day. Raises ValueError where neither can be there."""
    if ":" not in text and not re.match(r"\d{8}T\d{6}", text):
        raise ValueError(text)
    found = _PARTED.match(text)
    return (found[1], found[2]) if found else ("", text)


def _without_zone(clock: str) -> tuple[str, float | None]:
    """A time of day, and its distance from UTC in s where it says one."""
    found = _ZONE.search(clock)
    if not found:
        return clock, None
    zone = found[1].replace(":", "")
    if zone in ("Z", "UTC"):
        return clock[: found.start()], 0.0
    seconds = _HOUR_S * int(zone[1:3]) + 60.0 * int(zone[3:] or 0)
    return clock[: found.start()], -seconds if zone[0] == "-" else seconds


def _of_clock(text: str) -> tuple[float, float]:
    """Seconds since midnight, or of a duration, and those after which such a clock goes round. Raises ValueError."""
    half = _HALF_OF_DAY.search(text)
    text = text[: half.start()] if half else text
    if not half and (found := _MINUTES.match(text)):
        minutes, seconds = int(found[1]), int(found[2])
        if minutes > 59 or seconds > 59:
            raise ValueError(text)
        return 60.0 * minutes + float(f"{seconds}.{found[3]}"), _HOUR_S
    found = _CLOCK.match(text) or _COLON_MS.match(text) or _COMPACT_CLOCK.match(text)
    if not found:
        raise ValueError(text)
    hours, minutes, seconds = (int(part or 0) for part in found.groups()[:3])
    if minutes > 59 or seconds > 59 or (half and not 1 <= hours <= 12):
        raise ValueError(text)
    if half:
        hours = hours % 12 + (12 if half[1] in "Pp" else 0)
    return _HOUR_S * hours + 60.0 * minutes + float(f"{seconds}.{found[4] or 0}"), _DAY_S


def _check_day(text: str) -> None:
    """Raise ValueError where a text is no day at all."""
    if not _SLASHES.match(text):
        _date(text)
    else:
        _orders(text)


def _date(text: str) -> date:
    """A day whose order is told. Raises ValueError for others, and for days that no calendar has."""
    if found := _YEAR_FIRST.match(text):
        return date(int(found[1]), int(found[3]), int(found[4]))
    if found := _COMPACT.match(text):
        return date(int(found[1]), int(found[2]), int(found[3]))
    if found := _DAY_FIRST.match(text):
        return date(int(found[3]), int(found[2]), int(found[1]))
    if (found := _MONTH_BY_NAME.match(text)) and found[2].lower() in _MONTHS:
        return date(int(found[3]), _MONTHS.index(found[2].lower()) + 1, int(found[1]))
    raise ValueError(text)


def _orders(text: str) -> dict[str, date]:
    """A day with slashes as day first and as month first, where the calendar has it. Raises ValueError for neither."""
    found = _SLASHES.match(text)
    if not found:
        raise ValueError(text)
    out: dict[str, date] = {}
    for order, day, month in (("day", 1, 2), ("month", 2, 1)):
        try:
            out[order] = date(int(found[3]), int(found[month]), int(found[day]))
        except ValueError:
            continue
    if not out:
        raise ValueError(text)
    return out


def _days_between(first: str, later: str) -> dict[str, int]:
    """Whole days by the order of day and month, two where both could be meant. Raises ValueError for no day."""
    if first == later:
        return {"": 0}
    if not _SLASHES.match(first):
        return {"": (_date(later) - _date(first)).days}
    begun, now = _orders(first), _orders(later)
    both = {order: (now[order] - begun[order]).days for order in begun if order in now}
    if not both:
        raise ValueError(later)
    return both


def is_stamp(text: str) -> bool:
    """Whether a field is a date with a time, a time of day or a duration."""
    try:
        Stamps().seconds(text)
    except ValueError:
        return False
    return True
