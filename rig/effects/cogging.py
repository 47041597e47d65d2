"""Cogging: a torque that is periodic in the angle."""

from __future__ import annotations

import math

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * math.sin(p[5] * angle) + p[4] * math.cos(p[5] * angle)


def _orders(scale: Scale) -> tuple[float, ...]:
    # With less than half a period over the travel the torque is like a polynomial spring, with more than some twenty
    # like noise.
    lowest = max(1.0, 0.5 * math.pi / scale.angle_rad)
    highest = min(400.0, 60.0 / scale.angle_rad)
    if scale.angle_rad > math.pi:
        return (*(float(n) for n in range(1, 31)), *scale.orders)
    count = 24
    return (*(lowest * (highest / lowest) ** (i / (count - 1)) for i in range(count)), *scale.orders)


EFFECT = Effect(
    name="cogging",
    family="position-dependent torque",
    place=Place.LOAD,
    equation="T = sine * sin(order * th) + cosine * cos(order * th)",
    source="Hanselman, Brushless Motors, cogging torque as a Fourier series in the angle",
    meaning="The magnets of the motor pull the rotor towards the slots, so that it prefers some angles.",
    sign="Resisting, like K th; th is counted from the zero of the encoder, with a gyro alone from the rest angle "
    "before the run.",
    parameters=(
        Parameter("sine", "N*m", "sine part", linear=True, low=-float("inf"), suffix="nm"),
        Parameter("cosine", "N*m", "cosine part", linear=True, low=-float("inf"), suffix="nm"),
        Parameter("order", "1/rad", "periods per turn", low=0.5, high=2000.0, start=_orders),
    ),
    kernel=_torque,
    may_push=True,
    formula="sine_nm * sin(order * angle_rad) + cosine_nm * cos(order * angle_rad)",
    is_flexible=True,
    goes_with=("angle",),
    repeats_over_angle="order",
    sought_alone=True,
    separated_by="from backlash and cubic stiffness: excite at several amplitudes, and move slowly through the whole "
    "travel",
)
