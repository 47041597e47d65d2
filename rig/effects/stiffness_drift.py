"""Stiffness drift: K changes while the run goes on."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * time * angle


EFFECT = Effect(
    name="stiffness_drift",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = slope * t * th, t counted from the start of each run",
    source="first-order expansion of K(t)",
    meaning="Warming flexures and settling cables: the spring is not the same at the end of the run.",
    sign="K is the stiffness at the start of the run; a positive slope stiffens.",
    parameters=(
        Parameter(
            "slope",
            "N*m/(rad*s)",
            "change of K per second",
            linear=True,
            low=-float("inf"),
            suffix="nm_rad_s",
        ),
    ),
    kernel=_torque,
    separated_by="from cubic stiffness: constant amplitude for longer",
)
