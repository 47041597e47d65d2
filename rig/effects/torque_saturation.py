"""Torque saturation: the drive cannot give what was asked."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _clip(x, step, state, p):  # type: ignore[no-untyped-def]
    return min(max(x, -p[0]), p[0])


EFFECT = Effect(
    name="torque_saturation",
    family="drive",
    place=Place.DRIVE,
    equation="M = clip(torque, -limit, limit)",
    source="current limit of the amplifier, or saturating iron",
    meaning="The drive's current limit cuts the peaks.",
    sign="A magnitude, the same in both directions.",
    parameters=(
        Parameter(
            "limit",
            "N*m",
            "largest torque",
            low=1e-9,
            suffix="nm",
            start=lambda scale: tuple(scale.torque_nm * f for f in (0.5, 0.7, 0.85, 0.95)),
        ),
    ),
    kernel=_clip,
    separated_by="from cubic stiffness: several frequencies at the same amplitude",
)
