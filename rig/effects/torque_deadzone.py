"""Torque dead zone: small torques do not reach the shaft."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _dead(x, step, state, p):  # type: ignore[no-untyped-def]
    return x - min(max(x, -p[0]), p[0])


def _beyond(torque_nm: Array, step_s: float, values: tuple[float, ...]) -> Array:
    """The width added in the direction of the torque; no torque asks for none."""
    return torque_nm + values[0] * np.sign(torque_nm)


EFFECT = Effect(
    name="torque_deadzone",
    family="drive",
    place=Place.DRIVE,
    equation="M = torque - clip(torque, -width, width)",
    source="PWM dead time, cross-over of the output stage",
    meaning="The output stage of the amplifier does not pass small torques (dead time, crossover).",
    sign="Never negative; the same in both directions.",
    parameters=(
        Parameter(
            "width",
            "N*m",
            "torque that is lost",
            low=0.0,
            suffix="nm",
            start=lambda scale: tuple(scale.torque_nm * f for f in (0.002, 0.01, 0.03, 0.1)),
        ),
    ),
    kernel=_dead,
    bends_torque=True,
    inverse=_beyond,
    separated_by="from backlash and Coulomb friction: excite at several frequencies",
)
