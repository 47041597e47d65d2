"""Torque scale: the torque on the shaft is not the one that was recorded, by a constant factor."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _scaled(x, step, state, p):  # type: ignore[no-untyped-def]
    return x * p[0]


EFFECT = Effect(
    name="torque_scale",
    family="drive",
    place=Place.DRIVE,
    equation="M = scale * torque",
    source="torque constant of the motor (Eq. 6), gear ratio, current sensor's gain",
    meaning="A torque constant or a current gain that is off by a few per cent.",
    sign="A factor; one where the recorded torque is the shaft's.",
    parameters=(
        Parameter(
            "scale",
            "1",
            "torque on the shaft over torque recorded",
            low=0.02,
            high=50.0,
            start=lambda scale: (1.01,),
            neutral=1.0,
        ),
    ),
    kernel=_scaled,
    needs_added_inertia=True,
    separated_by="from J, C and K: runs with a known inertia added (added_inertia_kg_m2)",
)
