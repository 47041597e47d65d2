"""Quadratic stiffness: a spring that is not symmetric."""

from __future__ import annotations

from rig.effects._small_angle import COSINE
from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * angle * angle


EFFECT = Effect(
    name="quadratic_stiffness",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = factor * th^2",
    source="Duffing 1918; Nayfeh and Mook, Nonlinear Oscillations, chapter 4",
    meaning="Preloaded springs and flexures that are stiffer on one side.",
    sign="factor > 0: stiffer at positive angles, softer at negative ones. th is counted from the rest angle before "
    "the run.",
    parameters=(
        Parameter("factor", "N*m/rad^2", "torque per angle^2", linear=True, low=-float("inf"), suffix="nm_rad2"),
    ),
    kernel=_torque,
    formula="factor_nm_rad2 * angle_rad * angle_rad",
    lower_order=("torque_offset",),
    never_separable={"unbalance": COSINE},
    separated_by="from unbalance: turn the base of the platform, or swing farther",
)
