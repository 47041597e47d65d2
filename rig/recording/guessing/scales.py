"""The factor from a column's numbers to SI units: from its unit, or from what the numbers do."""

from __future__ import annotations

import numpy as np

from rig.recording.guessing.columns import Column
from rig.recording.guessing.factor import Factor, stated_factor
from rig.recording.guessing.roles import Choice, Quantity, relation
from rig.recording.guessing.time_unit import time_factor
from rig.units import DEG, DIMENSIONS, SI, TURN

FACTOR_TOLERANCE = 0.03  # relative, of a factor between angle and rate
MIN_SCALE_CORRELATION = 0.95
# Where nobody says the unit: above this a number is rather degrees than radians.
DEGREES_FROM = {"rate": 100.0, "angle": TURN}
# (angle, rate) in units that go together, by the factor between the angle's derivative and the rate.
PAIRS = (
    ("deg", DEG, "rad/s", 1.0),
    ("rad", 1.0, "deg/s", DEG),
    ("deg", DEG, "rpm", TURN / 60),
    ("rad", 1.0, "rpm", TURN / 60),
    ("deg", DEG, "rev/s", TURN),
    ("rad", 1.0, "rev/s", TURN),
    ("rev", TURN, "rad/s", 1.0),
    ("rev", TURN, "deg/s", DEG),
    ("rev", TURN, "rpm", TURN / 60),
)


def axis_of(roles: dict[Quantity, Choice]) -> str:
    """ "linear" where a force, a speed or a position in metres was measured, else "rotary"."""
    units = [c.known_unit.dimension for one in roles.values() if (c := one.column) is not None and c.known_unit]
    return "linear" if {"force", "speed", "length"} & set(units) else "rotary"


def guess_factors(
    roles: dict[Quantity, Choice], axis: str, defaults: dict[Quantity, list[str]]
) -> dict[Quantity, Factor]:  # fmt: skip
    """One factor for every quantity that has a column. ``defaults`` are names whose unit the reader knows."""
    out: dict[Quantity, Factor] = {}
    for quantity, choice in roles.items():
        if choice.column is not None:
            out[quantity] = _alone(quantity, choice.column, axis, choice.column.name in defaults[quantity])
    if axis == "rotary" and "rate" in out and "angle" in out:
        out |= _together(roles, out)
    return out


def _alone(quantity: Quantity, column: Column, axis: str, is_default: bool) -> Factor:
    stated = stated_factor(quantity, column, axis, is_default)
    if quantity == "time":
        return time_factor(column, stated)
    if stated is not None:
        return stated
    dimension = DIMENSIONS[axis][quantity]
    peak = _peak(column)
    if axis == "rotary" and peak > DEGREES_FROM.get(quantity, np.inf):
        return Factor(DEG, f"deg{'/s' if quantity == 'rate' else ''}, as it reaches {peak:.4g}", False)
    return Factor(1.0, f"{SI[dimension]}, as no unit is stated", False)


def _peak(column: Column) -> float:
    assert column.values is not None
    return float(np.nanmax(np.abs(column.values - np.nanmedian(column.values))))


def _together(roles: dict[Quantity, Choice], found: dict[Quantity, Factor]) -> dict[Quantity, Factor]:
    """Angle and rate of one motion: each says the unit of the other. Empty where they say nothing new."""
    time, angle, rate = (roles[q].column for q in ("time", "angle", "rate"))
    both_sure = found["angle"].sure and found["rate"].sure
    if both_sure or time is None or time.values is None or angle is None or rate is None or not time.increases:
        return {}
    per_s = (time.known_unit.factor if time.known_unit else found["time"].value) or 1.0
    seen = relation(per_s * time.values, angle, rate)
    if seen is None or abs(seen[1]) < MIN_SCALE_CORRELATION:
        return {}
    if found["angle"].sure:
        return {"rate": _snapped(seen[0] * _known(angle, found["angle"]), "rate")}
    if found["rate"].sure:
        return {"angle": _snapped(_known(rate, found["rate"]) / seen[0], "angle")}
    return _both_unknown(seen[0], any(f.value == DEG for f in (found["angle"], found["rate"])))


def _both_unknown(factor: float, large: bool) -> dict[Quantity, Factor]:
    """Units that fit the factor between the angle's derivative and the rate; ``large``: numbers rather in degrees."""
    sign, turned = (1.0, "") if factor > 0 else (-1.0, ", with the opposite sign")
    why = f"as the angle changes {abs(factor):.4g} times as fast as the rate says"
    for angle_unit, of_angle, rate_unit, of_rate in PAIRS:
        if abs(of_angle * abs(factor) / of_rate - 1.0) < FACTOR_TOLERANCE:
            return {
                "angle": Factor(of_angle, f"{angle_unit}, {why}", True),
                "rate": Factor(sign * of_rate, f"{rate_unit}{turned}, {why}", sign > 0),
            }
    if abs(abs(factor) - 1.0) >= FACTOR_TOLERANCE:
        return {}
    value, unit = (DEG, "deg") if large else (1.0, "rad")
    why = "as angle and rate agree, and neither says its unit"
    return {
        "angle": Factor(value, f"{unit}, {why}", False),
        "rate": Factor(sign * value, f"{unit}/s{turned}, {why}", False),
    }


def _known(column: Column, found: Factor) -> float:
    if found.value is not None:
        return found.value
    if column.unit is not None:
        return column.unit.factor
    return column.suffix.factor if column.suffix is not None else 1.0


def _snapped(factor: float, quantity: str) -> Factor:
    """A factor that follows from the other channel, as the unit it is near to."""
    per_s, other = ("/s", "angle") if quantity == "rate" else ("", "rate")
    units = [(f"{name}{per_s}", value) for name, value in (("rad", 1.0), ("deg", DEG), ("rev", TURN), ("mrad", 1e-3))]
    units += [("rpm", TURN / 60)] if quantity == "rate" else []
    turned = "" if factor > 0 else ", with the opposite sign"
    for unit, value in units:
        if abs(abs(factor) / value - 1.0) < FACTOR_TOLERANCE:
            return Factor(float(np.sign(factor)) * value, f"{unit}{turned}, as it agrees with the {other}", factor > 0)
    return Factor(float(f"{factor:.6g}"), f"a unit of its own{turned}, by comparison with the {other}", False)
