"""Equations of the rig, written from the pages in docs/effects and from nothing else (compiled).

    J a + C w + K th + loads + sgn(w) friction = M + d

th angle in rad, w rate in rad/s, a acceleration in rad/s^2, M torque of the drive in N m, d disturbance in N m.
A load is a torque that resists; a drive effect changes the torque on its way to the shaft.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numba as nb

jit = nb.njit(cache=True, error_model="numpy")

LOADS = (
    "quadratic_damping", "directional_damping", "cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness",
    "backlash", "hysteresis", "creep", "stiffness_drift", "unbalance", "cogging", "torque_offset", "flexible_mode",
    "periodic_disturbance", "presliding_friction", "bump_stop", "hard_stops", "shaken_stiffness", "two_relaxations",
    "cable_bump", "settling_torque",
)  # fmt: skip
FRICTIONS = (
    "coulomb_friction", "stribeck_friction", "load_dependent_friction", "friction_by_angle", "warming_friction",
)  # fmt: skip
DRIVES = (
    "torque_delay", "actuator_lag", "torque_saturation", "torque_deadzone", "warming_gain", "sagging_gain",
    "coarse_torque", "sensor_lag",
)  # fmt: skip
CODES: Mapping[str, int] = {
    name: group * 100 + i for group, names in enumerate((LOADS, FRICTIONS, DRIVES)) for i, name in enumerate(names)
}
STATES: Mapping[str, int] = {
    "hysteresis": 1, "creep": 1, "flexible_mode": 2, "presliding_friction": 1, "two_relaxations": 2,
    "actuator_lag": 1, "warming_gain": 1, "sensor_lag": 1,
}  # fmt: skip
# Parameters in the order in which the compiled functions take them, in the units of docs/effects (rad, N m, s, Hz).
PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "quadratic_damping": ("factor",), "directional_damping": ("step",), "cubic_stiffness": ("factor",),
    "quadratic_stiffness": ("factor",), "bilinear_stiffness": ("step",), "backlash": ("half_gap",),
    "hysteresis": ("level", "yield_angle", "exponent", "share"), "creep": ("stiffness", "time"),
    "stiffness_drift": ("slope",), "unbalance": ("sine", "cosine"), "cogging": ("sine", "cosine", "order"),
    "torque_offset": ("level",), "flexible_mode": ("inertia", "frequency", "ratio"),
    "periodic_disturbance": ("sine", "cosine", "frequency"), "presliding_friction": ("level", "displacement"),
    "bump_stop": ("stiffness", "angle"), "hard_stops": ("stiffness", "angle", "other_angle"),
    "shaken_stiffness": ("depth", "frequency"), "two_relaxations": ("stiffness", "time", "other_time"),
    "cable_bump": ("level", "angle", "width"), "settling_torque": ("level", "time"),
    "coulomb_friction": ("level",), "stribeck_friction": ("coulomb", "static", "speed"),
    "load_dependent_friction": ("factor",), "friction_by_angle": ("level", "depth", "order", "phase"),
    "warming_friction": ("level", "depth", "time"),
    "torque_delay": ("delay",), "actuator_lag": ("time",), "torque_saturation": ("limit",),
    "torque_deadzone": ("width",), "warming_gain": ("loss", "time", "torque"), "sagging_gain": ("loss",),
    "coarse_torque": ("step",), "sensor_lag": ("time",),
}  # fmt: skip


@jit
def spring_load(code, th, w, t, k, p, q):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Resisting torque in N m of a load without memory; parameters begin at p[q]."""
    if code == 0:
        return p[q] * w * abs(w)
    if code == 1:
        return p[q] * max(w, 0.0)
    if code == 2:
        return p[q] * th * th * th
    if code == 3:
        return p[q] * th * th
    if code == 4:
        return p[q] * max(th, 0.0)
    if code == 5:
        return -k * min(max(th, -p[q]), p[q])
    if code == 8:
        return p[q] * max(t, 0.0) * th
    if code == 9:
        return p[q] * math.sin(th) + p[q + 1] * math.cos(th)
    if code == 10:
        return p[q] * math.sin(p[q + 2] * th) + p[q + 1] * math.cos(p[q + 2] * th)
    if code == 11:
        return p[q]
    if code == 13:
        x = 2.0 * math.pi * p[q + 2] * t
        return p[q] * math.sin(x) + p[q + 1] * math.cos(x) if t >= 0.0 else 0.0
    if code == 15:  # a rubber stop on one side
        return p[q] * max(th - p[q + 1], 0.0)
    if code == 16:  # stops on both sides, at angles that differ
        return p[q] * (max(th - p[q + 1], 0.0) + min(th + p[q + 2], 0.0))
    if code == 17:  # a stiffness that something outside modulates
        return p[q] * th * math.sin(2.0 * math.pi * p[q + 1] * t)
    if code == 19:  # a cable that catches at one angle
        x = (th - p[q + 1]) / p[q + 2]
        return p[q] * math.exp(-0.5 * x * x)
    if code == 20:  # a torque that dies away in every run as the rig warms
        return p[q] * math.exp(-max(t, 0.0) / p[q + 1])
    return 0.0


@jit
def load(code, th, w, t, k, y, dy, z, p, q):  # type: ignore[no-untyped-def]
    """Resisting torque in N m of a load; its states begin at y[z], its parameters at p[q]; fills dy[z:]."""
    if code == 6:
        size = abs(y[z]) ** p[q + 2]
        sign = 1.0 if w * y[z] > 0.0 else -1.0
        dy[z] = w / p[q + 1] * (1.0 - size * (p[q + 3] * sign + 1.0 - p[q + 3]))
        return p[q] * y[z]
    if code == 7:
        dy[z] = (th - y[z]) / p[q + 1]
        return p[q] * (th - y[z])
    if code == 12:
        own = 2.0 * math.pi * p[q + 1]
        pull = own * own * (th - y[z]) + 2.0 * p[q + 2] * own * (w - y[z + 1])
        dy[z] = y[z + 1]
        dy[z + 1] = pull
        return p[q] * pull
    if code == 14:
        dy[z] = (w - abs(w) * y[z]) / p[q + 1]
        return p[q] * y[z]
    if code == 18:  # a spring of two relaxations, the second of the square of the angle
        dy[z] = (th - y[z]) / p[q + 1]
        dy[z + 1] = (th * abs(th) - y[z + 1]) / p[q + 2]
        return p[q] * (th - y[z] + 6.0 * (th * abs(th) - y[z + 1]))
    return spring_load(code, th, w, t, k, p, q)


@jit
def friction(code, th, speed, t, torque, p, q):  # type: ignore[no-untyped-def]
    """Level of dry friction in N m, never negative; ``speed`` is the size of the rate in rad/s."""
    if code == 100:
        return p[q]
    if code == 101:
        x = speed / p[q + 2]
        return p[q] + (p[q + 1] - p[q]) * math.exp(-x * x)
    if code == 102:
        return p[q] * abs(torque)
    if code == 103:  # a bearing with a tight spot
        return p[q] * (1.0 + p[q + 1] * math.sin(p[q + 2] * th + p[q + 3]))
    return p[q] * (1.0 + p[q + 1] * math.exp(-max(t, 0.0) / p[q + 2]))  # grease that warms in every run


@jit
def drive(code, x, w, h, y, z, p, q):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Mean torque in N m over a step of h seconds behind one element, for a torque x held over it (not the delay)."""
    if code in (201, 207):
        a = math.exp(-h / p[q])
        mean = x + (y[z] - x) * (1.0 - a) * p[q] / h
        y[z] = x + (y[z] - x) * a
        return mean
    if code == 202:
        return min(max(x, -p[q]), p[q])
    if code == 203:
        return math.copysign(max(abs(x) - p[q], 0.0), x)
    if code == 204:  # the gain falls as the motor warms: heat is the square of the torque, smoothed
        y[z] += (x * x / (p[q + 2] * p[q + 2]) - y[z]) * (1.0 - math.exp(-h / p[q + 1]))
        return x * (1.0 - p[q] * y[z])
    if code == 205:  # less torque at speed
        return x * (1.0 - p[q] * abs(w))
    if code == 206:  # a converter that takes torque in coarse steps
        return p[q] * round(x / p[q])
    return x
