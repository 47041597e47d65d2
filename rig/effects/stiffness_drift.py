"""Stiffness drift: K changes during the run."""

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
    meaning="Warming flexures and settling cables: K at the end of a run is not K at its start.",
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
    foreseen=False,
    stays="K at the start of a further run is not that of the runs before it",
    separated_by="from cubic stiffness: record longer at constant amplitude",
)
