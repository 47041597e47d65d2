"""Torque saturation: the drive cannot give the torque that was commanded."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, filter_kernel

# Shares of the largest torque from which the search starts. They are close together near 1: a limit just below the
# largest torque clips one set only briefly, and the fit improves only very near the right value.
FRACTIONS = (0.5, 0.7, 0.8, 0.87, 0.92, 0.95, 0.97, 0.98, 0.987, 0.993, 0.997)


@filter_kernel
def _clip(x, step, state, p):  # type: ignore[no-untyped-def]
    return min(max(x, -p[0]), p[0])


EFFECT = Effect(
    name="torque_saturation",
    family="drive",
    place=Place.DRIVE,
    equation="M = clip(torque, -limit, limit)",
    source="current limit of the amplifier, or saturating iron",
    meaning="The current limit of the drive cuts off the peaks of the torque.",
    sign="Never negative; the same in both directions.",
    parameters=(
        Parameter(
            "limit",
            "N*m",
            "largest torque",
            low=1e-9,
            suffix="nm",
            start=lambda scale: tuple(scale.torque_nm * f for f in FRACTIONS),
        ),
    ),
    kernel=_clip,
    bends_torque=True,
    stays="above its limit the drive gives no more torque",
    separated_by="from cubic stiffness: excite at several frequencies with the same torque amplitude",
)
