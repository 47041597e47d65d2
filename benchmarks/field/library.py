"""What may be hidden in a field case: draws of every effect, which rigs it fits, and who passes for whom.

A draw gives numbers off any grid; ``gains`` carry the size and are scaled until the effect has the size asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.field.noise import draw_between as between
from benchmarks.field.rigs import Rig

Rng = np.random.Generator
Numbers = dict[str, float]


@dataclass(frozen=True)
class Scale:
    """How large the motion is without effects: rms and peaks, SI units."""

    torque: float
    torque_peak: float
    rate: float
    rate_peak: float
    angle: float
    angle_peak: float
    middle_hz: float  # rms of the rate over rms of the angle, over 2 pi
    torque_hz: float  # rms of the torque's slope over rms of the torque, over 2 pi
    seconds: float  # of one run
    rig: Rig


def _turned(rng: Rng, size: float) -> Numbers:
    phase = rng.uniform(0.0, 2.0 * math.pi)
    return {"sine": size * math.cos(phase), "cosine": size * math.sin(phase)}


def _stribeck(r: Rng, s: Scale) -> Numbers:
    level = 0.1 * s.torque
    return {"coulomb": level, "static": level * r.uniform(1.4, 2.4), "speed": s.rate * between(r, 0.08, 0.5)}


def _order(r: Rng, s: Scale) -> float:
    """Periods a radian: whole periods a turn where the axis turns far, several periods within the travel else."""
    low = max(1.0, 6.0 / s.angle_peak)
    highest = max(low * 1.2, 0.08 * 2.0 * math.pi * s.rig.sample_hz / s.rate_peak)
    return float(math.ceil(min(between(r, low, 8.0 * low), highest)))


def _pendulum(r: Rng, s: Scale) -> Numbers:
    phase = r.uniform(-0.6, 0.6)
    return {"sine": 0.3 * s.torque * math.cos(phase), "cosine": 0.3 * s.torque * math.sin(phase)}


def _mode(r: Rng, s: Scale) -> Numbers:
    hz = between(r, 0.7 * s.rig.high_hz, min(2.5 * s.rig.high_hz, 0.12 * s.rig.sample_hz))
    return {"inertia": 0.2 * s.rig.inertia, "frequency": hz, "ratio": between(r, 0.01, 0.1)}


@dataclass(frozen=True)
class Kind:
    """``gains`` carry the size; ``wants`` are fields of the rig that the effect needs."""

    draw: Callable[[Rng, Scale], Numbers]
    gains: tuple[str, ...]
    signed: bool = False
    spring: bool | None = None  # True: needs one, False: stands without
    most: float = 0.5  # largest rms of its torque over the rms of the torque
    by_angle: bool = False  # the angle's zero has to be the same in every run
    wants: Mapping[str, Any] = field(default_factory=dict)


_FAR = {"travel_rad": 2.5}
_COMMAND = {"torque_column": "command"}
LIBRARY: Mapping[str, Kind] = {
    "coulomb_friction": Kind(lambda r, s: {"level": 0.1 * s.torque}, ("level",), most=0.85),
    "stribeck_friction": Kind(_stribeck, ("coulomb", "static"), most=0.85),
    "presliding_friction": Kind(
        lambda r, s: {"level": 0.1 * s.torque, "displacement": s.angle_peak * between(r, 0.02, 0.2)},
        ("level",),
        most=0.8,
    ),
    "load_dependent_friction": Kind(lambda r, s: {"factor": 0.1}, ("factor",)),
    "quadratic_damping": Kind(lambda r, s: {"factor": 0.1 * s.torque / s.rate**2}, ("factor",)),
    "directional_damping": Kind(lambda r, s: {"step": 0.1 * s.torque / s.rate}, ("step",), signed=True),
    "cubic_stiffness": Kind(
        lambda r, s: {"factor": 0.1 * s.torque / s.angle**3}, ("factor",), signed=True, spring=True
    ),
    "quadratic_stiffness": Kind(
        lambda r, s: {"factor": 0.1 * s.torque / s.angle**2}, ("factor",), signed=True, spring=True
    ),
    "bilinear_stiffness": Kind(lambda r, s: {"step": 0.1 * s.torque / s.angle}, ("step",), signed=True, spring=True),
    "backlash": Kind(lambda r, s: {"half_gap": 0.05 * s.angle_peak}, ("half_gap",), spring=True),
    "hysteresis": Kind(
        lambda r, s: {
            "level": 0.1 * s.torque,
            "yield_angle": s.angle_peak * between(r, 0.1, 0.6),
            "exponent": r.uniform(1.0, 3.0),
            "share": r.uniform(0.3, 0.95),
        },
        ("level",),
        spring=True,
    ),
    "creep": Kind(
        lambda r, s: {
            "stiffness": 0.15 * s.torque / s.angle,
            "time": between(r, 0.3, 8.0) / (2.0 * math.pi * s.middle_hz),
        },
        ("stiffness",),
        spring=True,
    ),
    "stiffness_drift": Kind(
        lambda r, s: {"slope": 0.15 * s.torque / s.angle / s.seconds}, ("slope",), signed=True, spring=True
    ),
    "unbalance": Kind(_pendulum, ("sine", "cosine"), spring=False, by_angle=True, most=0.9, wants=_FAR),
    "cogging": Kind(
        lambda r, s: _turned(r, 0.1 * s.torque) | {"order": _order(r, s)}, ("sine", "cosine"), by_angle=True, most=0.7
    ),
    "torque_delay": Kind(lambda r, s: {"delay": 0.05 / (2.0 * math.pi * s.torque_hz)}, ("delay",), most=0.4),
    "actuator_lag": Kind(
        lambda r, s: {"time": 0.05 / (2.0 * math.pi * s.torque_hz)}, ("time",), most=0.4, wants=_COMMAND
    ),
    "torque_saturation": Kind(lambda r, s: {"limit": 0.9 * s.torque_peak}, (), most=0.4, wants=_COMMAND),
    "torque_deadzone": Kind(lambda r, s: {"width": 0.05 * s.torque}, ("width",), wants=_COMMAND),
    "torque_offset": Kind(
        lambda r, s: {"level": 0.1 * s.torque}, ("level",), signed=True, wants={"sensors": ("encoder", "both")}
    ),
    "flexible_mode": Kind(_mode, ("inertia",), most=0.7),
    "sensor_lag": Kind(
        lambda r, s: {"time": 0.05 / (2.0 * math.pi * s.torque_hz)}, ("time",), most=0.4, wants={"sensors": ("gyro",)}
    ),
    "periodic_disturbance": Kind(
        lambda r, s: _turned(r, 0.1 * s.torque) | {"frequency": between(r, 0.3 * s.rig.low_hz, 0.1 * s.rig.sample_hz)},
        ("sine", "cosine"),
    ),
}
OUTSIDE: Mapping[str, Kind] = {
    "bump_stop": Kind(
        lambda r, s: {"stiffness": 0.5 * s.torque / s.angle, "angle": r.uniform(0.5, 0.75) * s.angle_peak},
        ("stiffness",), by_angle=True,
    ),
    "hard_stops": Kind(
        lambda r, s: {
            "stiffness": 0.5 * s.torque / s.angle, "angle": r.uniform(0.4, 0.75) * s.angle_peak,
            "other_angle": r.uniform(0.4, 0.75) * s.angle_peak,
        }, ("stiffness",), by_angle=True,
    ),
    "shaken_stiffness": Kind(
        lambda r, s: {"depth": 0.15 * s.torque / s.angle, "frequency": s.middle_hz * between(r, 0.2, 3.0)},
        ("depth",), spring=True,
    ),
    "two_relaxations": Kind(
        lambda r, s: {
            "stiffness": 0.1 * s.torque / s.angle, "time": between(r, 0.1, 0.5) / s.middle_hz,
            "other_time": between(r, 1.0, 8.0) / s.middle_hz,
        }, ("stiffness",), spring=True,
    ),
    "cable_bump": Kind(
        lambda r, s: {
            "level": 0.2 * s.torque, "angle": r.uniform(-0.5, 0.5) * s.angle_peak, "width": 0.12 * s.angle_peak
        }, ("level",), by_angle=True,
    ),
    "settling_torque": Kind(lambda r, s: {"level": 0.2 * s.torque, "time": 0.3 * s.seconds}, ("level",), signed=True),
    "friction_by_angle": Kind(
        lambda r, s: {
            "level": 0.15 * s.torque, "depth": r.uniform(0.6, 0.95), "order": max(1.0, round(4.0 / s.angle_peak)),
            "phase": r.uniform(0.0, 6.28),
        }, ("level",), by_angle=True, most=0.7,
    ),
    "warming_friction": Kind(
        lambda r, s: {"level": 0.15 * s.torque, "depth": r.uniform(1.0, 2.5), "time": s.seconds * r.uniform(0.15, 0.4)},
        ("level",), most=0.7,
    ),
    "warming_gain": Kind(
        lambda r, s: {"loss": 0.1, "time": s.seconds * r.uniform(0.1, 0.4), "torque": s.torque}, ("loss",)
    ),
    "sagging_gain": Kind(lambda r, s: {"loss": 0.1 / s.rate}, ("loss",)),
    "coarse_torque": Kind(lambda r, s: {"step": 0.2 * s.torque}, ("step",), wants=_COMMAND),
}  # fmt: skip
EVERYTHING: Mapping[str, Kind] = {**LIBRARY, **OUTSIDE}

# What no record of torque and motion can part (docs/effects): naming one counts where the other is declared beside it.
INSEPARABLE: Mapping[str, frozenset[str]] = {
    "actuator_lag": frozenset({"sensor_lag"}),
    "sensor_lag": frozenset({"actuator_lag"}),
}
# Library effects that are part of an effect outside the library: naming them is not wrong.
PART_OF: Mapping[str, frozenset[str]] = {
    "friction_by_angle": frozenset({"coulomb_friction"}),
    "warming_friction": frozenset({"coulomb_friction"}),
    "two_relaxations": frozenset({"creep"}),  # its first relaxation is the library's
}
# Names that are true of a gyro behind a slow low-pass, where nothing was hidden.
LATE = frozenset({"sensor_lag", "actuator_lag", "torque_delay"})
# Pairs that make no sense together: one contains the other, or two act as one.
EXCLUSIVE = (
    frozenset({"coulomb_friction", "stribeck_friction", "presliding_friction", "load_dependent_friction", "hysteresis",
               "friction_by_angle", "warming_friction"}),
    frozenset({"torque_delay", "actuator_lag", "sensor_lag"}),
    frozenset({"cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness", "backlash", "bump_stop", "hard_stops"}),
    frozenset({"creep", "hysteresis", "two_relaxations"}),
    frozenset({"stiffness_drift", "shaken_stiffness", "unbalance"}),
    frozenset({"torque_offset", "unbalance", "directional_damping", "quadratic_stiffness", "settling_torque"}),
)  # fmt: skip


def drawn(name: str, rng: Rng, scale: Scale) -> Numbers:
    """Numbers of an effect of about a tenth of the torque."""
    numbers = EVERYTHING[name].draw(rng, scale)
    return scaled(name, numbers, -1.0) if EVERYTHING[name].signed and rng.random() < 0.5 else numbers


def scaled(name: str, numbers: Mapping[str, float], factor: float) -> Numbers:
    """The same effect, larger."""
    return {k: v * factor if k in EVERYTHING[name].gains else v for k, v in numbers.items()}


def wanted(names: tuple[str, ...], rng: Rng) -> tuple[bool, dict[str, Any]]:
    """Whether the rig has a spring, and fields of the rig that the effects ask for."""
    springs = {EVERYTHING[n].spring for n in names} - {None}
    spring = bool(rng.random() < 0.5) if not springs else springs.pop() is True
    want: dict[str, Any] = {}
    for name in names:
        for key, value in EVERYTHING[name].wants.items():
            want[key] = str(rng.choice(value)) if isinstance(value, tuple) else value
    if "travel_rad" in want:
        want["travel_rad"] = float(want["travel_rad"] * rng.uniform(0.6, 2.0))
    if any(EVERYTHING[n].by_angle for n in names):
        want["zero_anew"] = False
    return spring, want


def agree(names: tuple[str, ...]) -> bool:
    """Whether effects make sense on one rig."""
    springs = {EVERYTHING[n].spring for n in names} - {None}
    sensors = [EVERYTHING[n].wants["sensors"] for n in names if "sensors" in EVERYTHING[n].wants]
    return len(springs) <= 1 and len(sensors) <= 1 and all(len(group & set(names)) <= 1 for group in EXCLUSIVE)


def spectral_middle(series: Any, step_s: float) -> float:
    """rms of the slope over rms, over 2 pi, in Hz."""
    x = np.asarray(series)
    slope = np.diff(x) / step_s
    return float(np.sqrt(np.mean(slope**2) / max(float(np.mean((x - x.mean()) ** 2)), 1e-300)) / (2.0 * math.pi))
