"""Times of day and dates as loggers write them, as seconds."""

from __future__ import annotations

import re
from datetime import datetime, time

_DAY_S = 86_400.0
_HALF_A_DAY_S = 43_200.0
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})(?=[ T])")
_YEAR_FIRST = re.compile(r"(\d{4})/(\d{1,2})/(\d{1,2})(?=[ T])")
_MONTH_BY_NAME = re.compile(r"(\d{1,2})-([A-Za-z]{3})-(\d{4})(?=[ T])")  # of MATLAB's datetime
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2})?([.,]\d+)?$")


class Stamps:
    """Turns the stamps of one column, in their order, into seconds since the first one's midnight.

    Since midnight and not since 1970: a float has 4e-12 s of room left there. A clock without a date that falls by
    more than half a day has passed midnight.
    """

    def __init__(self) -> None:
        self._midnight: datetime | None = None
        self._before = 0.0
        self._days = 0.0

    def seconds(self, text: str) -> float:
        """Seconds of one stamp. Raises ValueError where the text is none."""
        text = text.strip()
        if CLOCK.match(text):
            clock = time.fromisoformat(text if text.index(":") == 2 else f"0{text}")
            now = _of_day(clock) + self._days
            if now < self._before - _HALF_A_DAY_S:
                self._days += _DAY_S
                now += _DAY_S
            self._before = now
            return now
        moment = moment_of(text)
        if self._midnight is None:
            self._midnight = moment.replace(hour=0, minute=0, second=0, microsecond=0)
        return (moment - self._midnight).total_seconds()


def _of_day(clock: time) -> float:
    return 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond


def moment_of(text: str) -> datetime:
    """ISO 8601, or a date as 31.12.2024, 31-Dec-2024 or 2024/12/31 before the time. Raises ValueError for others.

    05/06/2024 is none: it is the fifth of June here and the sixth of May there.
    """
    if ":" not in text:
        raise ValueError(text)
    text = _DAY_FIRST.sub(lambda m: f"{m[3]}-{int(m[2]):02}-{int(m[1]):02}", text, count=1)
    text = _YEAR_FIRST.sub(lambda m: f"{m[1]}-{int(m[2]):02}-{int(m[3]):02}", text, count=1)
    if (named := _MONTH_BY_NAME.match(text)) and named[2].lower() in _MONTHS:
        month = _MONTHS.index(named[2].lower()) + 1
        text = f"{named[3]}-{month:02}-{int(named[1]):02}{text[named.end() :]}"
    return datetime.fromisoformat(text)


def is_stamp(text: str) -> bool:
    """Whether a field is a date with a time, or a time of day."""
    try:
        Stamps().seconds(text)
    except ValueError:
        return False
    return True
