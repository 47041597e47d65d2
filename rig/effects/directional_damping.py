"""Directional damping: a different C in each direction."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * max(rate, 0.0)


EFFECT = Effect(
    name="directional_damping",
    family="friction",
    place=Place.LOAD,
    equation="T = step * max(w, 0)",
    source="asymmetric viscous friction, as observed on electro-mechanical positioning systems",
    meaning="Seals, worm gears and one-way lubrication: the damping depends on the direction of motion.",
    sign="C is the damping at negative rates; step is added at positive rates.",
    parameters=(
        Parameter(
            "step",
            "N*m*s/rad",
            "damping added at positive rates",
            linear=True,
            low=-float("inf"),
            suffix="nm_s_rad",
        ),
    ),
    kernel=_torque,
    formula="step_nm_s_rad * fmax(rate_rad_s, 0.0)",
    lower_order=("torque_offset",),
    separated_by="from damping: move in both directions at several speeds",
)
