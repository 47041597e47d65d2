"""Free-form torques: what a model lacks and no effect of the library describes, as a curve over what it goes with.

Each is a torque that is piecewise linear in one quantity, alone or as the gain of another. They stand for no physics
and are never named. They compete with the effects: where a curve over the angle explains clearly more than a delay
does, the delay was the wrong name.

A curve has no part that a term of the platform has: one over the angle or the rate is zero at both ends of the range
(a straight line is K or C) and has a constant beside it, a gain that changes is zero where it begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numba

from rig.effects.base import Effect, Parameter, Place, kernel

INNER = 7  # places between the ends of a range
CHANGES = 4  # places of a gain that changes
MEMORIES = 4  # times over which a spring remembers, each APART times the one before
APART = 4.0

jit = numba.njit(cache=True, error_model="numpy", inline="always")


@jit
def _bent(x, p):  # type: ignore[no-untyped-def]
    """p[5] plus a line from p[3] to p[4] through zero, INNER values from p[6] on, and zero; straight on beyond."""
    u = (x - p[3]) / (p[4] - p[3]) * (INNER + 1)
    i = int(min(max(u, 0.0), INNER))
    left = p[5 + i] if i > 0 else 0.0
    right = p[6 + i] if i < INNER else 0.0
    return p[5] + left + (u - i) * (right - left)


@jit
def _changing(x, p):  # type: ignore[no-untyped-def]
    """From zero at p[3] piecewise linear through CHANGES values from p[5] on, the last of them at p[4]."""
    u = min(max((x - p[3]) / (p[4] - p[3]), 0.0), 1.0) * CHANGES
    i = min(int(u), CHANGES - 1)
    left = p[4 + i] if i > 0 else 0.0
    return left + (u - i) * (p[5 + i] - left)


@jit
def _level(x, p):  # type: ignore[no-untyped-def]
    """Through INNER values from p[5] on, at even places from p[3] to p[4]; never negative."""
    u = min(max((x - p[3]) / (p[4] - p[3]), 0.0), 1.0) * (INNER - 1)
    i = min(int(u), INNER - 2)
    return max(p[5 + i] + (u - i) * (p[6 + i] - p[5 + i]), 0.0)


@kernel
def _of_angle(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _bent(angle, p)


@kernel
def _of_rate(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _bent(rate, p)


@kernel
def _of_torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _bent(torque, p)


@kernel
def _of_time(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _bent(time, p)


@kernel
def _gain_over_time(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return torque * _changing(time, p)


@kernel
def _gain_over_speed(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return torque * _changing(abs(rate), p)


@kernel
def _spring_over_time(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return angle * _changing(time, p)


@kernel
def _friction_over_angle(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _level(angle, p)


@kernel
def _friction_over_time(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return _level(time, p)


@kernel
def _memory(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    out, constant = 0.0, p[3]
    for k in range(MEMORIES):
        dstate[k] = (angle - state[k]) / constant
        out += p[5 + k] * (angle - state[k])
        constant *= APART
    return out


def _curve(
    on: str, over: str, equation: str, kernel_: Any, unit: str, values: int, place: Place = Place.LOAD, **more: Any
) -> Effect:
    """One of them: two shapes that the motion gives (where the curve begins and ends), then the curve's values."""
    low = 0.0 if place is Place.FRICTION else -math.inf
    ends = (
        Parameter("begin", over, "where the curve begins", low=-math.inf, searched=False),
        Parameter("end", over, "where the curve ends", low=-math.inf, searched=False),
    )
    return Effect(
        name=f"free_{on}", family="free form", place=place, equation=equation,
        source="piecewise linear curve (de Boor, A Practical Guide to Splines, 1978)",
        meaning="Not an effect: a curve that shows what a model lacks.", sign="Resisting.",
        parameters=(
            *ends, *(Parameter(f"value_{k}", unit, f"value {k} of the curve", True, low) for k in range(values))
        ),
        kernel=kernel_, is_flexible=True, sought_alone=True, **more,
    )  # fmt: skip


FREE_FORMS: Mapping[str, Effect] = {
    e.name: e
    for e in (
        _curve("angle", "rad", "T = f(th)", _of_angle, "N*m", INNER + 1),
        _curve("rate", "rad/s", "T = f(w)", _of_rate, "N*m", INNER + 1),
        _curve("torque", "N*m", "T = f(M)", _of_torque, "N*m", INNER + 1),
        _curve("time", "s", "T = f(t)", _of_time, "N*m", INNER + 1),
        _curve("gain_over_time", "s", "T = f(t) M", _gain_over_time, "1", CHANGES),
        _curve("gain_over_speed", "rad/s", "T = f(|w|) M", _gain_over_speed, "1", CHANGES),
        _curve("spring_over_time", "s", "T = f(t) th", _spring_over_time, "N*m/rad", CHANGES),
        _curve(
            "friction_over_angle",
            "rad",
            "T = f(th) sgn(w)",
            _friction_over_angle,
            "N*m",
            INNER,
            Place.FRICTION,
            nests=("coulomb_friction",),
        ),
        _curve(
            "friction_over_time",
            "s",
            "T = f(t) sgn(w)",
            _friction_over_time,
            "N*m",
            INNER,
            Place.FRICTION,
            nests=("coulomb_friction",),
        ),
        _curve(
            "memory",
            "s",
            "T = sum of k (th - z), dz/dt = (th - z) / time",
            _memory,
            "N*m/rad",
            MEMORIES,
            states=MEMORIES,
            has_linear_states=True,
            rest_state=lambda angle, rate: (angle,) * MEMORIES,
            fastest_rad_s=lambda values: 0.3 / values[3],
        ),
    )
}
