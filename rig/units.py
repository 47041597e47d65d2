"""Units as people write them over a column: what they measure, and the factor to SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

DEG = math.pi / 180.0
TURN = 2.0 * math.pi
NS = 1e-9
G = 9.80665  # standard gravity, m/s^2
LBF = 4.4482216152605  # N: 0.45359237 kg times G
INCH = 0.0254

# Dimension -> unit, without spaces, dots and stars -> factor to s, N m, N, rad/s, m/s, rad, m.
_FACTORS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "torque": {
        "nm": 1.0, "mnm": 1e-3, "knm": 1e3, "unm": 1e-6, "ncm": 1e-2, "nmm": 1e-3, "kgfm": G, "kgfcm": 1e-2 * G,
        "lbfft": 12 * INCH * LBF, "ftlbf": 12 * INCH * LBF, "lbft": 12 * INCH * LBF, "ftlb": 12 * INCH * LBF,
        "lbfin": INCH * LBF, "inlbf": INCH * LBF, "lbin": INCH * LBF, "inlb": INCH * LBF,
        "ozfin": INCH * LBF / 16, "ozin": INCH * LBF / 16, "inoz": INCH * LBF / 16,
    },
    "force": {"n": 1.0, "mn": 1e-3, "kn": 1e3, "un": 1e-6, "kgf": G, "lbf": LBF},
    "rate": {
        "rad/s": 1.0, "mrad/s": 1e-3, "urad/s": 1e-6, "deg/s": DEG, "dps": DEG, "mdeg/s": 1e-3 * DEG,
        "mdps": 1e-3 * DEG, "deg/h": DEG / 3600, "deg/min": DEG / 60, "rpm": TURN / 60, "rev/min": TURN / 60,
        "r/min": TURN / 60, "1/min": TURN / 60, "/min": TURN / 60, "u/min": TURN / 60, "tr/min": TURN / 60,
        "rev/s": TURN, "rps": TURN, "tr/s": TURN, "krpm": 1e3 * TURN / 60,
    },
    "speed": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "um/s": 1e-6, "in/s": INCH, "km/h": 1 / 3.6},
    "angle": {
        "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": DEG, "mdeg": 1e-3 * DEG, "arcmin": DEG / 60,
        "arcsec": DEG / 3600, "rev": TURN, "gon": math.pi / 200,
    },
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "in": INCH},
    # Known so that a column of them is told from one that nobody knows; no factor makes a torque of them.
    "current": {"a": 1.0, "ma": 1e-3}, "voltage": {"v": 1.0, "mv": 1e-3}, "temperature": {"k": 1.0, "degc": 1.0},
    "acceleration": {"rad/s2": 1.0, "deg/s2": DEG, "m/s2": 1.0, "g": G},
}  # fmt: skip
_WORDS = {
    "seconds": "s", "second": "s", "secs": "s", "sec": "s", "milliseconds": "ms", "millisecond": "ms", "msec": "ms",
    "microseconds": "us", "microsecond": "us", "usec": "us", "minutes": "min", "minute": "min", "hours": "h",
    "degrees": "deg", "degree": "deg", "degs": "deg", "radians": "rad", "radian": "rad", "rads": "rad", "hr": "h",
    "revolutions": "rev", "revs": "rev", "turns": "rev", "turn": "rev", "newtons": "n", "newton": "n", "meters": "m",
    "meter": "m", "metres": "m", "metre": "m", "volts": "v", "volt": "v", "amperes": "a", "ampere": "a", "amps": "a",
    "amp": "a", "inches": "in", "inch": "in", "pounds": "lb", "lbs": "lb", "feet": "ft", "foot": "ft", "per": "/",
}  # fmt: skip
_SIGNS = str.maketrans(
    {"°": "deg", "º": "deg", "µ": "u", "μ": "u", "Ω": "ohm", "²": "2", "⁻": "-", "¹": "1", "−": "-", "∕": "/"}
)
# Which dimension a quantity has, on a rotary and on a linear axis.
DIMENSIONS: Mapping[str, Mapping[str, str]] = {
    "rotary": {"time": "time", "torque": "torque", "rate": "rate", "angle": "angle"},
    "linear": {"time": "time", "torque": "force", "rate": "speed", "angle": "length"},
}
SI: Mapping[str, str] = {
    "time": "s", "torque": "N m", "force": "N", "rate": "rad/s", "speed": "m/s", "angle": "rad", "length": "m"
}  # fmt: skip
_GERMAN_DEGREE = re.compile(r"\bGrad\b")  # with a capital, as nouns have it there; an English grad is a gon
_BRACKETS = re.compile(r"^(?P<name>.*\S)\s*(?:\((?P<round>[^()]*)\)|\[(?P<square>[^][]*)\])\s*$")
_IN = re.compile(r"^(?:(?P<name>.*\S)\s+)?in\s+(?P<unit>\S.*)$")  # "C1 in V": of Rohde & Schwarz
_SLASH = re.compile(r"^(?P<name>[^/]*[^/\s])\s*/\s*(?P<unit>\S.*)$")


@dataclass(frozen=True)
class Unit:
    """A unit of a column.

    ``factor`` turns its numbers into those of ``SI``; ``text`` is what stood there.
    """

    text: str
    dimension: str
    factor: float


def unit_of(text: str) -> Unit | None:
    """The unit that a text names ("N m", "deg/s", "[ms]", "°"), None where it is not known."""
    words = _GERMAN_DEGREE.sub("deg", bare(text))
    if words.startswith("M") and not words.isupper():
        return None  # "MN m" is no millinewton metre
    plain = re.sub(r"[^\W\d_]+", lambda m: _WORDS.get(m[0], m[0]), words.translate(_SIGNS).lower())
    plain = re.sub(r"[\s·⋅*]+|\.(?!\d)", " ", plain).strip()
    plain = re.sub(r" ?(s|min|h) ?\^? ?-1$", r"/\1", plain).replace("**", "^")
    plain = re.sub(r"(?<=[a-z]) ?- ?(?=[a-z])|[\^() ]", "", plain)
    return next((Unit(bare(text), d, units[plain]) for d, units in _FACTORS.items() if plain in units), None)


def bare(text: str) -> str:
    """A unit without the brackets around it."""
    text = text.strip()
    inside = re.fullmatch(r"\(([^()]*)\)|\[([^][]*)\]", text)
    return (inside[1] if inside[1] is not None else inside[2]).strip() if inside else text


def name_and_unit(header: str) -> tuple[str, str]:
    """ "rate (deg/s)", "torque [N m]", "t/s" and "rate in deg/s" as name and unit, "" where the header names none.

    Whatever stands in brackets at the end and has a letter counts as a unit (the 0 of rate[0] is an index); behind a
    slash and behind "in" only what is known as one.
    """
    found = _BRACKETS.match(header)
    if found:
        inside = (found["round"] if found["round"] is not None else found["square"]).strip()
        if any(c.isalpha() or c in "°%" for c in inside):
            return found["name"].rstrip(" /"), inside
        return header, ""
    found = _IN.match(header)
    if found and unit_of(found["unit"]) is not None and unit_of(f"in {found['unit']}") is None:  # "in lbf" is a torque
        return found["name"] or "", found["unit"].strip()
    found = _SLASH.match(header)
    if found and unit_of(found["unit"]) is not None and unit_of(header) is None:
        name, _, last = found["name"].rpartition(" ")
        whole = f"{last}/{found['unit'].strip()}"
        if name and unit_of(whole) is not None:
            return name.rstrip(), whole  # "rate deg/s" is no "rate deg" in seconds
        return found["name"], found["unit"].strip()
    return header, ""
