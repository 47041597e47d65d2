"""Torque scale: the torque on the shaft is a constant factor times the recorded one."""

from __future__ import annotations

from rig.arrays import Array
from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _scaled(x, step, state, p):  # type: ignore[no-untyped-def]
    return x * p[0]


def _divided(torque_nm: Array, step_s: float, values: tuple[float, ...]) -> Array:
    return torque_nm / values[0]


EFFECT = Effect(
    name="torque_scale",
    family="drive",
    place=Place.DRIVE,
    equation="M = scale * torque",
    source="torque constant of the motor (Eq. 6 of the paper), gear ratio, gain of the current sensor",
    meaning="The torque constant or the gain of the current sensor is wrong by a few per cent.",
    sign="1: the recorded torque is that of the shaft; above 1 the shaft gets more.",
    parameters=(
        Parameter(
            "scale",
            "1",
            "torque on the shaft over recorded torque",
            low=0.02,
            high=50.0,
            start=lambda scale: (1.01,),
            neutral=1.0,
        ),
    ),
    kernel=_scaled,
    needs_added_inertia=True,
    inverse=_divided,
    separated_by="from J, C and K: add a known inertia in some runs (added_inertia_kg_m2)",
)
