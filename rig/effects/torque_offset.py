"""Torque offset: a constant torque in addition to the recorded one."""

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
    source="zero error of the current sensor, or a constant load",
    meaning="Zero error of the current sensor, a hanging weight, a preload. On a platform with a spring it only "
    "shifts the rest angle, which a gyro alone does not measure.",
    sign="Resisting: a positive level pushes towards negative angles.",
    parameters=(Parameter("level", "N*m", "constant torque", linear=True, low=-float("inf"), suffix="nm"),),
    kernel=_torque,
    formula="level_nm",
    separated_by="from asymmetric friction: move in both directions; use an encoder, or a platform without a spring",
)
