"""Fitted values compared with declared ones: factors that a wrong unit or a wrong sign would make.

A wrong scale of torque or rate multiplies J, C and K alike. A wrong unit of time multiplies K/J by its square. One
number that is off beside others that agree is a matter of the declared number itself. J and K off by the same few
percent are what a torque constant makes. Anything else is silence: a declared number is often a guess.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from identify.conclude.acceptance import opposite_signs
from identify.results import Identification, Implausible
from identify.wording import SYMBOLS, half_interval, joined, number
from rig.platform import TERMS
from rig.units import TURN

DECLARED_TOLERANCE = math.log(1.15)  # of a factor, either way: what a declared number is good for
# Of two declared numbers that share a factor: a computed inertia is good for a percent or two.
COMMON_FACTOR_TOLERANCE = math.log(1.02)
MIN_SCALE, MAX_SCALE = math.log(1.05), math.log(2.0)  # a torque constant's tolerance; beyond, it is no calibration
MAX_RELATIVE_INTERVAL = 0.1  # half the 95 % interval over the value: worse says nothing of a factor
DEGREES, RPM = 180.0 / math.pi, 30.0 / math.pi  # deg in a rad, rpm in a rad/s
GRAVITY, THOUSAND = 9.80665, 1e3  # newtons to a kgf; a prefix: milli, or kilo
FREQUENCY = TURN**2  # (rad/s)^2 in a Hz^2: of K/J, where a frequency in Hz was taken for rad/s
Channel = Literal["rate", "angle"]


@dataclass(frozen=True)
class Cause:
    """A factor of fitted over declared, and what makes it: "as if ..."."""

    factor: float
    words: str


# Of torque over rate, which J, C and K share.
OF_RATE = (
    Cause(1.0 / DEGREES, "the rate were in deg/s and read as rad/s"),
    Cause(DEGREES, "the rate were already in rad/s but converted from deg/s"),
    Cause(TURN, "the rate were in turns per second and read as rad/s"),
    Cause(1.0 / TURN, "the rate were already in rad/s but converted from turns per second"),
    Cause(1.0 / RPM, "the rate were in rpm and read as rad/s, or the torque in kgf m and read as N m"),
    Cause(
        RPM,
        "the rate were in rad/s but converted from rpm, or the torque in N m but converted from kgf m",
    ),
    Cause(THOUSAND, "the torque were in mN m and read as N m"),
    Cause(1.0 / THOUSAND, "the rate were in mrad/s and read as rad/s"),
)
# The same where the angle is measured: factors of units, by definition.
OF_ANGLE = (
    Cause(1.0 / DEGREES, "the angle were in degrees and read as rad"),
    Cause(DEGREES, "the angle were already in rad but converted from degrees"),
    Cause(TURN, "the angle were in turns and read as rad"),
    Cause(1.0 / TURN, "the angle were already in rad but converted from turns"),
    Cause(1.0 / GRAVITY, "the torque were in kgf m and read as N m"),
    Cause(GRAVITY, "the torque were already in N m but converted from kgf m"),
    Cause(THOUSAND, "the torque were in mN m and read as N m"),
    Cause(1.0 / THOUSAND, "the angle were in mrad and read as rad"),
)
# Of force over position on a linear axis: factors of units, by definition.
OF_POSITION = (
    Cause(1.0 / GRAVITY, "the force were in kgf and read as N"),
    Cause(GRAVITY, "the force were already in N but converted from kgf"),
    Cause(THOUSAND, "the force were in mN and read as N"),
    Cause(1.0 / THOUSAND, "the motion were in mm and read as m"),
)
# Of one declared number, where the others agree.
OF_ONE = {
    "inertia": (
        Cause(1e-3, "it were in g m^2"), Cause(1e-4, "it were in kg cm^2"), Cause(1e-6, "it were in kg mm^2"),
        Cause(1e-7, "it were in g cm^2"), Cause(GRAVITY, "it were in kgf m s^2"),
        Cause(1.0 / FREQUENCY, "it were calculated from K with a frequency in Hz instead of rad/s"),
    ),
    "damping": (Cause(DEGREES, "it were per deg/s"), Cause(RPM, "it were per rpm")),
    "stiffness": (
        Cause(DEGREES, "it were per degree"), Cause(TURN, "it were per turn"), Cause(1e-3, "it were in mN m/rad"),
        Cause(GRAVITY, "it were in kgf m/rad"),
        Cause(FREQUENCY, "it were calculated from J with a frequency in Hz instead of rad/s"),
    ),
}  # fmt: skip
# The same on a linear axis.
OF_ONE_LINEAR = {
    "inertia": (Cause(1e-3, "it were in g"), Cause(GRAVITY, "it were in kgf s^2/m")),
    "damping": (),
    "stiffness": (
        Cause(THOUSAND, "it were in N/mm"), Cause(GRAVITY, "it were in kgf/m"),
        Cause(FREQUENCY, "it were calculated from the mass with a frequency in Hz instead of rad/s"),
    ),
}  # fmt: skip
# Of the time: factors of units, by definition.
OF_TIME = (
    Cause(THOUSAND, "the time were in ms and read as s"),
    Cause(1e-3, "the time were already in s but converted from ms"),
)
# Of K/J of a free decay, a squared frequency: by definition.
OF_SQUARED_FREQUENCY = (
    Cause(FREQUENCY, "it were calculated with a frequency in Hz instead of rad/s"),
    Cause(1e-6, "the time were in ms and read as s"),
    Cause(1e6, "the time were already in s but converted from ms"),
)


def with_declared(found: Identification, declared: Mapping[str, float]) -> Identification:
    """The same beside what somebody declared, with a sentence where the two differ by a telling factor.

    Parameters
    ----------
    declared
        Numbers that somebody gave, no defaults: "inertia" in kg m^2 (kg on a linear axis), "damping", "stiffness", and
        "effect.parameter" of declared effects.
    """
    known = _as_fitted(declared, found.torque_free)
    found = replace(found, declared=known)
    odd = implausible(found)
    verdict = replace(found.verdict, sentences=(*(o.sentence for o in odd), *found.verdict.sentences))
    return replace(found, plausibility=odd, verdict=verdict)


def _as_fitted(declared: Mapping[str, float], torque_free: bool) -> dict[str, float]:
    """By the names of the table; without torque per unit of inertia, effects left out."""
    if not torque_free:
        return dict(declared)
    inertia = declared.get("inertia")
    given = [n for n in ("damping", "stiffness") if n in declared]
    return {f"{n}_over_inertia": declared[n] / inertia for n in given} if inertia else {}


def implausible(found: Identification) -> tuple[Implausible, ...]:
    """Every fitted number that is off from its declared one by a factor with a likely cause."""
    ratios = {
        name: estimate.value / found.declared[name]
        for name, estimate in found.final.parameters.items()
        if found.declared.get(name) and half_interval(estimate) <= MAX_RELATIVE_INTERVAL * abs(estimate.value)
    }
    if found.torque_free:
        return _without_torque(ratios)
    jck = {name: ratios[name] for name in TERMS if name in ratios}
    if not jck or opposite_signs(found):
        return ()
    channel: Channel = found.traces[0].channel if found.traces else "rate"
    linear = found.axis == "linear"
    scales = OF_POSITION if linear else OF_RATE if channel == "rate" else OF_ANGLE
    shared = _alike(jck, scales) or _in_time(jck, channel) or _only_one(jck, scales)
    single = tuple(_single(jck, OF_ONE_LINEAR if linear else OF_ONE))
    return shared or single or (() if found.scale_shows else _of_torque_scale(jck, linear))


def _is(ratio: float, factor: float) -> bool:
    return ratio * factor > 0.0 and abs(math.log(ratio / factor)) < DECLARED_TOLERANCE


def _alike(jck: Mapping[str, float], causes: tuple[Cause, ...]) -> tuple[Implausible, ...]:
    """A factor that J and K share, or whichever two there are; a damping is rarely known, and has no veto."""
    deciding = [n for n in ("inertia", "stiffness") if n in jck]
    deciding = deciding if len(deciding) == 2 else list(jck)
    for cause in causes if len(deciding) > 1 else ():
        if all(_is(jck[n], cause.factor) for n in deciding):
            names = tuple(n for n in jck if _is(jck[n], cause.factor))
            return (_implausible(names, jck, f"as if {cause.words}: check this unit, then the declared values"),)
    return ()


def _of_torque_scale(jck: Mapping[str, float], linear: bool) -> tuple[Implausible, ...]:
    """A factor of no unit that J and K share, as a torque constant off by some percent makes it."""
    if "inertia" not in jck or "stiffness" not in jck or min(jck.values()) <= 0.0:
        return ()
    apart = abs(math.log(jck["inertia"] / jck["stiffness"]))
    factor = math.sqrt(jck["inertia"] * jck["stiffness"])
    if apart > COMMON_FACTOR_TOLERANCE or not MIN_SCALE < abs(math.log(factor)) < MAX_SCALE:
        return ()
    torque, kind = ("force", "mass") if linear else ("torque", "inertia")
    words = (
        f"as a scale error of the {torque} or of the sensor would make it: add runs with a known added {kind} "
        "(added_inertia_kg_m2), which show the scale, or check the declared values"
    )
    return (_implausible(("inertia", "stiffness"), jck, words),)


def _only_one(jck: Mapping[str, float], causes: tuple[Cause, ...]) -> tuple[Implausible, ...]:
    """The only number that can be compared: the commonest factors alone, and either unit may be the wrong one."""
    name, ratio = next(iter(jck.items()))
    for cause in causes if len(jck) == 1 and name != "damping" else ():
        if max(cause.factor, 1.0 / cause.factor) in (DEGREES, THOUSAND) and _is(ratio, cause.factor):
            return (
                _implausible((name,), jck, f"as if {cause.words}: check this unit and the unit of the declared value"),
            )
    return ()


def _in_time(jck: Mapping[str, float], channel: Channel) -> tuple[Implausible, ...]:
    """What a wrong unit of time makes of J and K: K/J off by its square, each off by its own share of that."""
    if "inertia" not in jck or "stiffness" not in jck:
        return ()
    for cause in OF_TIME:
        unit = cause.factor
        j, k = (unit, 1.0 / unit) if channel == "rate" else (unit**2, 1.0)
        if _is(jck["inertia"], j) and _is(jck["stiffness"], k):
            words = f"as if {cause.words}: check recorded.scale.time"
            ratio = {"stiffness_over_inertia": jck["stiffness"] / jck["inertia"]}
            return (_implausible(("stiffness_over_inertia",), ratio, words),)
    return ()


def _single(jck: Mapping[str, float], causes: Mapping[str, tuple[Cause, ...]]) -> list[Implausible]:
    """Numbers that are off while J or K agrees."""
    agree = [n for n in ("inertia", "stiffness") if n in jck and _is(jck[n], 1.0)]
    out = []
    for name, ratio in jck.items() if agree else ():
        beside = f"while {joined([SYMBOLS[n] for n in agree])} {'agrees' if len(agree) == 1 else 'agree'}"
        for cause in causes[name]:
            if _is(ratio, cause.factor):
                words = f"{beside}, as if {cause.words}: check the declared value"
                out.append(_implausible((name,), jck, words))
        if _is(ratio, -1.0):
            out.append(_implausible((name,), jck, f"{beside}: check the sign of the declared value"))
    return out


def _without_torque(ratios: Mapping[str, float]) -> tuple[Implausible, ...]:
    name = "stiffness_over_inertia"
    for cause in OF_SQUARED_FREQUENCY if name in ratios else ():
        if _is(ratios[name], cause.factor):
            return (
                _implausible((name,), ratios, f"as if {cause.words}: check the unit of time and the declared values"),
            )
    return ()


def _implausible(names: tuple[str, ...], ratios: Mapping[str, float], words: str) -> Implausible:
    """With the factor that was found: the geometric mean where several numbers share it."""
    factor = math.prod(abs(ratios[n]) for n in names) ** (1.0 / len(names)) * math.copysign(1.0, ratios[names[0]])
    verb, values = ("is", "value") if len(names) == 1 else ("are", "values")
    symbols = joined([SYMBOLS[n] for n in names])
    return Implausible(names, factor, f"{symbols} {verb} {_times(factor)} the declared {values}, {words}.")


def _times(factor: float) -> str:
    if abs(factor) < 1.0 - DECLARED_TOLERANCE and factor > 0.0:
        return f"about 1/{number(1.0 / factor, 2)} of"
    return "the opposite of" if _is(factor, -1.0) else f"about {number(factor, 2)} times"
