"""What may be hidden: every effect with a draw of its numbers, off any grid.

A draw gives the numbers of an effect of about one per cent of the torque, and which of them carry its size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Rng = np.random.Generator
Numbers = dict[str, float]


@dataclass(frozen=True)
class Scale:
    """How large the motion without effects is: rms over all sets, and the peaks."""

    inertia: float
    damping: float
    stiffness: float
    torque: float
    torque_peak: float
    torque_hz: float  # rms of the torque's slope over rms of the torque, over 2 pi
    angle: float
    angle_peak: float
    rate: float
    duration_s: float

    @property
    def natural_hz(self) -> float:
        """Natural frequency."""
        return math.sqrt(self.stiffness / self.inertia) / (2.0 * math.pi)


def _between(rng: Rng, low: float, high: float) -> float:
    """Log-uniform."""
    return float(low * (high / low) ** rng.random())


def _sign(rng: Rng) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _stribeck(rng: Rng, s: Scale) -> Numbers:
    level = 0.01 * s.torque
    return {"coulomb": level, "static": level * rng.uniform(1.15, 2.2), "speed": s.rate * _between(rng, 0.02, 0.3)}


def _hysteresis(rng: Rng, s: Scale) -> Numbers:
    return {
        "level": 0.013 * s.torque, "yield_angle": s.angle_peak * _between(rng, 0.04, 0.5),
        "exponent": rng.uniform(1.0, 3.0), "share": rng.uniform(0.25, 0.95),
    }  # fmt: skip


def _turned(rng: Rng, size: float) -> Numbers:
    phase = rng.uniform(0.0, 2.0 * math.pi)
    return {"sine": size * math.cos(phase), "cosine": size * math.sin(phase)}


def _late(s: Scale) -> float:
    return 0.01 / (2.0 * math.pi * s.torque_hz)


def _mode(rng: Rng, s: Scale) -> Numbers:
    frequency = _between(rng, 0.6 * s.natural_hz, 6.0 * s.natural_hz)
    return {"inertia": 0.05 * s.inertia, "frequency": frequency, "ratio": _between(rng, 0.004, 0.1)}


def _coupling(rng: Rng, s: Scale) -> Numbers:
    inertia = s.inertia * rng.uniform(0.1, 0.4)
    stiffness = inertia * (2.0 * math.pi * _between(rng, 90.0, 250.0)) ** 2
    damping = 2.0 * 0.05 * math.sqrt(inertia * stiffness)
    return {
        "inertia": inertia,
        "stiffness": stiffness,
        "slip": s.torque_peak * rng.uniform(1.1, 1.8),
        "damping": damping,
    }


def _aliased(rng: Rng, s: Scale) -> Numbers:
    wander = 0.0 if rng.random() < 0.5 else rng.uniform(0.3, 1.5)
    return {"amplitude": 0.014 * s.rate, "frequency": rng.uniform(985.0, 995.0), "wander": wander}


@dataclass(frozen=True)
class Kind:
    """``gains`` carry the size, all other numbers are shapes; ``signed``: may turn its sign."""

    draw: Callable[[Rng, Scale], Numbers]
    gains: tuple[str, ...]
    signed: bool = False
    channel: str = "rate"


LIBRARY: Mapping[str, Kind] = {
    "coulomb_friction": Kind(lambda r, s: {"level": 0.01 * s.torque}, ("level",)),
    "stribeck_friction": Kind(_stribeck, ("coulomb", "static")),
    "presliding_friction": Kind(
        lambda r, s: {"level": 0.01 * s.torque, "displacement": s.angle_peak * _between(r, 0.006, 0.15)}, ("level",)
    ),
    "load_dependent_friction": Kind(lambda r, s: {"factor": 0.01}, ("factor",)),
    "quadratic_damping": Kind(lambda r, s: {"factor": 0.006 * s.torque / s.rate**2}, ("factor",)),
    "directional_damping": Kind(lambda r, s: {"step": 0.014 * s.torque / s.rate}, ("step",), signed=True),
    "cubic_stiffness": Kind(lambda r, s: {"factor": 0.004 * s.torque / s.angle**3}, ("factor",), signed=True),
    "quadratic_stiffness": Kind(lambda r, s: {"factor": 0.007 * s.torque / s.angle**2}, ("factor",), signed=True),
    "bilinear_stiffness": Kind(lambda r, s: {"step": 0.014 * s.torque / s.angle}, ("step",), signed=True),
    "backlash": Kind(lambda r, s: {"half_gap": 0.01 * s.torque / s.stiffness}, ("half_gap",)),
    "hysteresis": Kind(_hysteresis, ("level",)),
    "creep": Kind(
        lambda r, s: {"stiffness": 0.015 * s.torque / s.angle, "time": _between(r, 0.02, 2.0)}, ("stiffness",)
    ),
    "stiffness_drift": Kind(lambda r, s: {"slope": 0.02 * s.torque / s.angle / s.duration_s}, ("slope",), signed=True),
    "unbalance": Kind(lambda r, s: _turned(r, 0.012 * s.torque / s.angle), ("sine", "cosine")),
    "cogging": Kind(
        lambda r, s: _turned(r, 0.014 * s.torque) | {"order": _between(r, 2.0, 12.0) / s.angle_peak}, ("sine", "cosine")
    ),
    "torque_delay": Kind(lambda r, s: {"delay": _late(s)}, ("delay",)),
    "actuator_lag": Kind(lambda r, s: {"time": _late(s)}, ("time",)),
    "torque_saturation": Kind(lambda r, s: {"limit": 0.9 * s.torque_peak}, ()),
    "torque_deadzone": Kind(lambda r, s: {"width": 0.01 * s.torque}, ("width",)),
    "torque_offset": Kind(lambda r, s: {"level": 0.01 * s.torque}, ("level",), signed=True, channel="angle"),
    "flexible_mode": Kind(_mode, ("inertia",)),
    "sensor_lag": Kind(lambda r, s: {"time": _late(s)}, ("time",)),
    "periodic_disturbance": Kind(
        lambda r, s: {"amplitude": 0.014 * s.torque, "frequency": _between(r, 1.3, 120.0)}, ("amplitude",)
    ),
    "rate_bias": Kind(lambda r, s: {"bias": 0.01 * s.rate}, ("bias",), signed=True),
}

OUTSIDE: Mapping[str, Kind] = {
    "bump_stop": Kind(
        lambda r, s: {
            "stiffness": 0.3 * s.stiffness, "angle": r.uniform(0.5, 0.8) * s.angle_peak * _sign(r) ** 2,
            "damper_s": _between(r, 1e-4, 3e-3),
        }, ("stiffness",),
    ),
    "hard_stops": Kind(
        lambda r, s: {
            "stiffness": 0.1 * s.stiffness, "angle": r.uniform(0.35, 0.7) * s.angle_peak,
            "other_angle": r.uniform(0.35, 0.7) * s.angle_peak,
        }, ("stiffness",),
    ),
    "shaken_stiffness": Kind(
        lambda r, s: {"depth": 0.014 * s.torque / s.angle, "frequency": _between(r, 0.3, 15.0)}, ("depth",)
    ),
    "two_relaxations": Kind(
        lambda r, s: {
            "stiffness": 0.01 * s.torque / s.angle, "time": _between(r, 0.01, 0.05), "other_time": _between(r, 0.2, 2.0)
        }, ("stiffness",),
    ),
    "friction_by_angle": Kind(
        lambda r, s: {
            "level": 0.01 * s.torque, "depth": r.uniform(0.5, 0.9), "order": _between(r, 1.0, 4.0) / s.angle_peak,
            "phase": r.uniform(0.0, 6.28),
        }, ("level",),
    ),
    "torque_ripple": Kind(
        lambda r, s: {
            "amplitude": 0.014 * s.torque, "period": s.torque_peak * r.uniform(0.2, 0.7), "phase": r.uniform(0.0, 6.28)
        }, ("amplitude",),
    ),
    "warming_gain": Kind(lambda r, s: {"loss": 0.012, "time": r.uniform(2.0, 9.0), "torque": s.torque}, ("loss",)),
    "coupling_slip": Kind(_coupling, ()),
    "standing_tone": Kind(  # a hum that was always there: no record of torque and rate parts it from a line of the gyro
        lambda r, s: {"amplitude": 0.014 * s.torque, "frequency": _between(r, 1.3, 120.0)}, ("amplitude",)
    ),
    "sagging_gain": Kind(lambda r, s: {"loss": 0.01 / s.rate}, ("loss",)),
    "coarse_torque": Kind(
        lambda r, s: {"amplitude": 0.014 * s.torque, "period": s.torque_peak * r.uniform(0.05, 0.15)}, ("amplitude",)
    ),
    "aliased_vibration": Kind(_aliased, ("amplitude",)),
    "cubic_gyro": Kind(lambda r, s: {"factor": 0.004 / s.rate**2}, ("factor",), signed=True),
}  # fmt: skip

# What no record of torque and rate can part (PHYSICS of the rig, not of the tool): naming one counts
# where the other is named beside it.
INSEPARABLE: Mapping[str, frozenset[str]] = {
    "actuator_lag": frozenset({"sensor_lag"}),
    "sensor_lag": frozenset({"actuator_lag"}),
    "unbalance": frozenset({"quadratic_stiffness", "cubic_stiffness"}),
    "quadratic_stiffness": frozenset({"unbalance"}),
    "cubic_stiffness": frozenset({"unbalance"}),
}
EVERYTHING = {**LIBRARY, **OUTSIDE}


def drawn(name: str, rng: Rng, scale: Scale) -> Numbers:
    """Numbers of an effect of about one per cent."""
    kind = EVERYTHING[name]
    numbers = kind.draw(rng, scale)
    return sized(name, numbers, _sign(rng)) if kind.signed else numbers


def sized(name: str, numbers: Mapping[str, float], factor: float) -> Numbers:
    """The same effect, larger."""
    gains = EVERYTHING[name].gains
    return {k: v * factor if k in gains else v for k, v in numbers.items()}
