"""Words that stand in the place of a number: those for no reading, and those for yes and no."""

from __future__ import annotations

import re

EMPTY = frozenset(("", "na", "n/a", "null", "none", "-"))
# What devices and spreadsheets write where there is no reading, an overflow or a failure among them.
NO_READING = EMPTY.union(
    ("nan", "-nan", "+nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan", "1.#inf", "-1.#inf"),
    ("#n/a", "#na", "#nv", "#num!", "#zahl!", "#value!", "#wert!", "#div/0!", "#ref!", "n.a.", "n.d.", "nd", "nil"),
    ("--", "---", "----", "*", "**", "***", "?", "∞", "-∞", "+∞", "ol", "-ol", "+ol", "o.l.", "over", "under"),
    ("overflow", "overrange", "over-range", "over range", "overload", "ovld", "ovfl", "underrange", "off-scale"),
    ("err", "error", "fault", "fail", "failed", "timeout", "invalid", "bad", "lost", "missing", "open", "no signal"),
    ("nodata", "no_data", "no data", "off scale", "not a number", "out of range"),
)
# Thousands that are told by the decimal sign behind them; without one, 1,234 may be either.
_COMMAS = re.compile(r"[-+]?\d{1,3}(,\d{3})+\.\d*$")
_POINTS = re.compile(r"[-+]?\d{1,3}(\.\d{3})+,\d*$")
# Spaces that do not break a line, and the apostrophe, between thousands as spreadsheets write them in some countries.
_BETWEEN = re.compile(
    "(?<=\\d)[\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}'\N{RIGHT SINGLE QUOTATION MARK}](?=\\d{3})"
)
_FORTRAN = re.compile(r"([-+]?(?:\d+[.,]?\d*|[.,]\d+))[dD]([-+]\d+)$")  # 1.5D+01: Fortran's double precision
TRUTH = {"true": 1.0, "false": 0.0}


def number(text: str, decimal_comma: bool) -> float:
    """A field as a number, NaN where it says that there is none. Raises ValueError for anything else."""
    text = text.strip()
    if not text.isascii() or "'" in text:
        text = _BETWEEN.sub("", text.replace("\N{MINUS SIGN}", "-"))
    if text.lower() in NO_READING:
        return float("nan")
    if "_" in text:
        raise ValueError(text)
    if text.lower() in TRUTH:
        return TRUTH[text.lower()]
    if "D" in text or "d" in text:
        text = _FORTRAN.sub(r"\1e\2", text)
    if decimal_comma:
        text = text.replace(".", "") if _POINTS.match(text) else text
        if "." in text:
            raise ValueError(text)  # 1.234 beside decimal commas: nobody knows what the point is
        return float(text.replace(",", "."))
    return float(text.replace(",", "") if _COMMAS.match(text) else text)


def has_points_between(text: str) -> bool:
    """Whether points stand between the thousands of a number with a decimal comma: 1.234,5."""
    return bool(_POINTS.match(text))


def is_number(text: str) -> bool:
    """Whether a field is a number with a point or a comma, and no word in its place."""
    try:
        number(text, "," in text and not _COMMAS.match(text.strip()))
    except ValueError:
        return False
    return text.strip().lower() not in NO_READING
