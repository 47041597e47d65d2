"""Which column is the time, the torque, the rate, the angle: by words, by units, and by what the numbers do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np

from rig.arrays import Array
from rig.recording.consistency import angle_over_rate
from rig.recording.guessing.columns import Column
from rig.recording.run import Run
from rig.units import DIMENSIONS

Quantity = Literal["time", "torque", "rate", "angle"]
QUANTITIES: tuple[Quantity, ...] = ("time", "rate", "angle", "torque")  # in the order of the choice


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


WORDS: dict[Quantity, frozenset[str]] = {
    "time": _words("time t zeit timestamp clock sec seconds elapsed second temps tiempo x"),
    "torque": _words("torque torq trq moment drehmoment couple tau effort m mot force f kraft load τ"),
    "rate": _words(
        "rate speed velocity vel omega w gyro gyr gz drehrate drehzahl geschwindigkeit geschw qd dq dtheta thetadot "
        "rpm spd ω"
    ),
    "angle": _words("angle position pos theta th phi q winkel lage encoder enc ang weg θ φ"),
}
MIN_LETTERS_INSIDE_WORD = 5  # letters from which a word counts inside of another: motordrehmoment
CURRENT_WORDS = _words("current i iq strom amps")
ONLY_CURRENT_WORDS = CURRENT_WORDS - {"current"}  # which, in "current position", means the present one
# Which say a quantity beyond doubt besides.
PLAIN = {q: frozenset(w for w in WORDS[q] if len(w) >= MIN_LETTERS_INSIDE_WORD) for q in WORDS}
NOT_MEASURED = _words("ref reference cmd command set setpoint soll target demand desired error err limit")
COUNTERS = _words("index sample samples n nr no count counter row id zeile")
MAX_COLUMNS_IN_SENTENCE = 8  # columns in a sentence
MIN_ROLE_CORRELATION = 0.99  # correlation of an angle and an integrated rate


@dataclass(frozen=True)
class Choice:
    """The column of a quantity; ``why`` in words, ``sure`` where nobody has to be asked.

    None that is sure: there is no such column. None that is not: somebody has to say it, for there is no guess.
    """

    column: Column | None
    why: str
    sure: bool
    said: bool = False  # by a person


def guess_roles(columns: Sequence[Column], given: dict[Quantity, Column | None]) -> dict[Quantity, Choice]:
    """One choice a quantity. ``given`` are those that somebody named, None for "there is none"."""
    chosen = {q: Choice(c, "as given", True, said=True) for q, c in given.items()}
    left = [c for c in columns if c.values is not None and all(c is not g for g in given.values())]
    if "time" in given:
        left = [c for c in left if not says_time(c)]
    for quantity in QUANTITIES:
        if quantity in chosen:
            continue
        if quantity == "time":
            made = _time(left)
            left = [c for c in left if not says_time(c)]
        else:
            made = _by_words(quantity, left)
        if made.column is not None:
            left = [c for c in left if c is not made.column]
        chosen[quantity] = made
    if not {"rate", "angle"} & set(given):
        chosen |= _by_motion(chosen, left)
        left = [c for c in left if all(c is not one.column for one in chosen.values())]
    elif chosen["rate"].column is None and chosen["angle"].column is None and "rate" not in given:
        chosen["rate"] = _last_that_moves(chosen, left)
    if chosen["torque"].column is None and "torque" not in given:
        chosen["torque"] = _remaining_torque(left)
    elif "torque" not in given:
        chosen["torque"] = _acting(chosen["torque"])
    return chosen


def _score(column: Column, quantity: Quantity) -> float:
    """How well words and unit fit; above zero is a candidate."""
    score = 0.0
    unit = column.known_unit
    fitting = {DIMENSIONS[axis][quantity] for axis in DIMENSIONS}
    if unit is not None:
        is_current = quantity == "torque" and unit.dimension == "current"
        score += 2.0 if unit.dimension in fitting else 0.5 if is_current else -4.0
    score += 2.0 if _has_word(column, WORDS[quantity]) else 0.0
    if quantity == "torque" and _has_word(column, CURRENT_WORDS):
        score += 0.5
    elif _has_word(column, ONLY_CURRENT_WORDS):
        score -= 4.0  # the q of i_q is no angle
    if quantity == "angle" and _has_word(column, WORDS["rate"]):
        score -= 1.5  # angular velocity, angle rate
    return score - (1.0 if score > 0 and set(column.words) & NOT_MEASURED else 0.0)


def says_time(column: Column) -> bool:
    """Whether a column is a time by its unit or by the last word of its name, or by any word where it increases."""
    if column.known_unit is not None:
        return column.known_unit.dimension == "time"
    return column.words[-1:] in (("time",), ("zeit",), ("timestamp",)) or (
        _has_word(column, WORDS["time"]) and column.increases
    )


def unread(columns: Sequence[Column], quantity: Quantity) -> Column | None:
    """A column whose name or unit says that it is the quantity, but whose values cannot be read; None for none."""
    there = [c for c in columns if c.values is None and c.single is None]
    lost = [(score, c) for c in there if (score := _score(c, quantity)) > 0.0]
    return max(lost, key=lambda one: one[0])[1] if lost else None


def unused_rate(columns: Sequence[Column], roles: dict[Quantity, Choice]) -> list[str]:
    """What may be the rate and is not read, as an angle is enough: a line of words, or none.

    Neither name nor unit of it says what it is.
    """
    angle, rate = roles["angle"].column, roles["rate"]
    if angle is None or rate.column is not None or rate.said:
        return []
    taken = [c for one in roles.values() if (c := one.column) is not None]
    moving = [c for c in columns if c.values is not None and all(c is not one for one in taken) and _may_be_any(c)]
    moving = [c for c in moving if all(_score(c, quantity) <= 0.0 for quantity in QUANTITIES)]
    said = f"no rate is read beside the angle {angle.name!r} ({_unused(moving)}): if one of these is the rate, name it"
    return [said] if moving else []


def _has_word(column: Column, words: frozenset[str]) -> bool:
    return any(w in words or any(len(k) >= MIN_LETTERS_INSIDE_WORD and k in w for k in words) for w in column.words)


def _by_words(quantity: Quantity, left: Sequence[Column]) -> Choice:
    scores = [(_score(c, quantity), c) for c in left]
    best = max((s for s, _ in scores), default=0.0)
    if best <= 0.0:
        return Choice(None, "no name or unit says so", quantity in ("rate", "angle"))
    several = [c for s, c in scores if s == best]
    is_named = _has_word(several[0], WORDS[quantity])
    why = "by its name" if is_named else "by its unit" if several[0].known_unit else "as a current"
    if len(several) > 1:
        first = _liveliest(several)
        others = ", ".join(repr(c.name) for c in [c for c in several if c is not first][:3])
        return Choice(first, f"{why}, as {others} might be, too", False)
    another = next((q for q in PLAIN if q != quantity and _has_word(several[0], PLAIN[q])), None)
    if another is not None and not is_named:
        return Choice(several[0], f"by its unit, though its name says {another}", False)
    return Choice(several[0], why, True)


def _liveliest(columns: Sequence[Column]) -> Column:
    """The one that moves most (of a gyro's three axes the driven one); the first where their units differ in kind."""
    moving = [c for c in columns if c.moves] or list(columns)
    if len({None if c.known_unit is None else c.known_unit.dimension for c in moving}) > 1:
        return moving[0]
    return max(moving, key=_size)


def _size(column: Column) -> float:
    """The standard deviation, in SI units where the unit is known."""
    factor = 1.0 if column.known_unit is None else column.known_unit.factor
    return 0.0 if column.values is None else factor * float(np.nanstd(column.values))


def _time(left: Sequence[Column]) -> Choice:
    rising = [c for c in left if c.increases]
    named = [c for c in left if _score(c, "time") > 0.0]
    both = [c for c in rising if c in named]
    if both:
        best = max(both, key=lambda c: (_score(c, "time"), -left.index(c)))
        return Choice(best, "its name or unit says time, and it increases", True)
    plain = [c for c in rising if not set(c.words) & COUNTERS]
    if len(plain) == 1 or (plain and len(plain) < len(left) and plain[0] is left[0]):
        return Choice(plain[0], "it increases", len(plain) == 1)
    if named:
        return Choice(named[0], "its name or unit says time, but it does not increase throughout", False)
    if rising:
        return Choice(rising[0], "it increases", len(rising) == 1)
    return Choice(None, "no column increases throughout", False)


def _by_motion(chosen: dict[Quantity, Choice], left: Sequence[Column]) -> dict[Quantity, Choice]:
    """Angle and rate where words alone do not part them: one column is the integral of the other."""
    time, named = chosen["time"].column, [one for q in ("rate", "angle") if (one := chosen[q]).column is not None]
    if any(one.sure for one in named) or len(named) == 2:
        return {}
    among = [c for one in named if (c := one.column)] + [c for c in left if _may_be_any(c)]
    if named:  # several columns fit one word: those alone
        quantity: Quantity = "rate" if chosen["rate"].column is not None else "angle"
        among = [c for c in among if _score(c, quantity) > 0.0]
    if time is None or time.values is None or not time.increases:
        return {}
    # With its sign: at a single tone either is the other's integral, up to a negative factor.
    pairs = [(found[1], a, w) for a, w in permutations(among[:8], 2) if (found := relation(time.values, a, w))]
    if pairs:
        strength, angle, rate = max(pairs, key=lambda pair: pair[0])
        if strength > MIN_ROLE_CORRELATION:
            return {
                "angle": Choice(angle, f"{rate.name!r} is its derivative", bool(named)),
                "rate": Choice(rate, f"it is the derivative of {angle.name!r}", bool(named)),
            }
    return {} if named else {"rate": _last_that_moves(chosen, left)}


def _may_be_any(column: Column) -> bool:
    """Whether a column of which nothing is said may be a measured channel: it moves, and is no flag of 0 and 1."""
    is_flag = column.values is not None and bool(np.isin(column.values, (0.0, 1.0)).all())
    is_counter = column.increases and bool(set(column.words) & COUNTERS)  # n is a speed, too
    return column.moves and column.known_unit is None and not is_flag and not is_counter


def _last_that_moves(chosen: dict[Quantity, Choice], left: Sequence[Column]) -> Choice:
    moving = [c for c in left if _may_be_any(c) and c is not chosen["torque"].column]
    if moving:
        return Choice(moving[-1], "it is the last column that moves", False)
    others = [c for c in left if c.moves]
    return Choice(None, f"no rate and no angle was recognised ({_unused(others)})" if others else "", not others)


def relation(time_s: Array, angle: Column, rate: Column) -> tuple[float, float] | None:
    """Factor and correlation of one column against the integral of another, both as stored."""
    if angle.values is None or rate.values is None:
        return None
    good = np.isfinite(time_s) & np.isfinite(angle.values) & np.isfinite(rate.values)
    run = Run("", time_s[good], np.ones(int(good.sum()), bool), rate.values[good], angle.values[good])
    return angle_over_rate(run)


def _remaining_torque(left: Sequence[Column]) -> Choice:
    moving = [c for c in left if _may_be_any(c)]
    if len(moving) == 1:
        return Choice(moving[0], "it is the only column left", False)
    # A recording whose torque was overlooked and one without torque are the same to the identification.
    return Choice(None, f"no torque was recognised ({_unused([c for c in left if c.moves])})", False)


def _unused(moving: Sequence[Column]) -> str:
    """The columns that somebody may have to choose from, in words."""
    more = f" and {len(moving) - MAX_COLUMNS_IN_SENTENCE} more" if len(moving) > MAX_COLUMNS_IN_SENTENCE else ""
    listed = ", ".join(repr(c.name) for c in moving[:MAX_COLUMNS_IN_SENTENCE]) + more
    return f"not used, but they move: {listed}" if moving else "and no other column moves"


def _acting(torque: Choice) -> Choice:
    """The same, unless the column never changes: a drive that was off, a channel that was not connected."""
    column = torque.column
    if column is None or column.values is None or column.moves:
        return torque
    value = float(column.values[np.isfinite(column.values)][0]) + 0.0  # no -0
    return Choice(None, f"column {column.name!r} says so by its name or unit, but is {value:g} throughout", False)
