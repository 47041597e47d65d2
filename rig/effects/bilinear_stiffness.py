"""Bilinear stiffness: a different K on each side of zero."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * max(angle, 0.0)


EFFECT = Effect(
    name="bilinear_stiffness",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = step * max(th, 0)",
    source="Shaw and Holmes 1983, piecewise linear oscillator",
    meaning="A support or cable that acts on one side only.",
    sign="K is the stiffness at negative angles; step is added at positive angles.",
    parameters=(
        Parameter(
            "step",
            "N*m/rad",
            "stiffness added at positive angles",
            linear=True,
            low=-float("inf"),
            suffix="nm_rad",
        ),
    ),
    kernel=_torque,
    formula="step_nm_rad * fmax(angle_rad, 0.0)",
    kinks=lambda values: (0.0,),
    separated_by="from quadratic stiffness: excite at a small and at a large amplitude",
)
