"""Torque offset: a constant torque besides the commanded one."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3]


EFFECT = Effect(
    name="torque_offset",
    family="drive",
    place=Place.LOAD,
    equation="T = level",
    source="offset of the current sensor or a constant load",
    meaning="A current sensor's zero error, a hanging weight, a preload. With a gyro and a spring "
    "it only shifts the unseen rest angle.",
    sign="Resisting: a positive level pushes towards negative angles.",
    parameters=(Parameter("level", "N*m", "constant torque", linear=True, low=-float("inf"), suffix="nm"),),
    kernel=_torque,
    separated_by="from asymmetric friction: motion in both directions; an encoder, or no spring",
)
