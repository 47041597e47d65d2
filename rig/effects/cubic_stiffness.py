"""Cubic stiffness: a spring that hardens or softens with the angle."""

from __future__ import annotations

from rig.effects._small_angle import SINE
from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * angle * angle * angle


EFFECT = Effect(
    name="cubic_stiffness",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = factor * th^3",
    source="Duffing 1918; Nayfeh and Mook, Nonlinear Oscillations, chapter 4",
    meaning="Flexures and cables that stiffen (factor > 0) or soften (factor < 0) with deflection.",
    sign="Resisting, like K th; the angle is counted from the rest angle at the start of the run.",
    parameters=(
        Parameter("factor", "N*m/rad^3", "torque per angle^3", linear=True, low=-float("inf"), suffix="nm_rad3"),
    ),
    kernel=_torque,
    formula="factor_nm_rad3 * angle_rad * angle_rad * angle_rad",
    never_separable={"unbalance": SINE},
    separated_by=(
        "from unbalance: turn the base of the platform, or swing farther; "
        "from backlash: excite at a small and at a large amplitude"
    ),
)
