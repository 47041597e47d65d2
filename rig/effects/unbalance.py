"""Unbalance: gravity acts on a centre of mass that is off the axis."""

from __future__ import annotations

import math

from rig.effects._small_angle import COSINE, SINE
from rig.effects.base import Effect, LargeStart, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * math.sin(angle) + p[4] * math.cos(angle)


def _as_cubic(values: tuple[float, ...]) -> LargeStart:
    sine, _ = values
    return LargeStart({"stiffness": sine}, {"factor": -sine / 6.0})


def _as_quadratic(values: tuple[float, ...]) -> LargeStart:
    sine, cosine = values
    return LargeStart({"stiffness": sine}, {"factor": -0.5 * cosine})


EFFECT = Effect(
    name="unbalance",
    family="position-dependent torque",
    place=Place.LOAD,
    equation="T = sine * sin(th) + cosine * cos(th)",
    source="m g r sin(th + phase), expanded",
    meaning="The load is not balanced: gravity turns its centre of mass towards the lowest point.",
    sign="Resisting, like K th: sine > 0 if the load hangs down at th = 0. Within a small travel sine cannot be "
    "separated from K.",
    parameters=(
        Parameter("sine", "N*m", "m g r cos(phase)", linear=True, low=-float("inf"), suffix="nm"),
        Parameter("cosine", "N*m", "m g r sin(phase)", linear=True, low=-float("inf"), suffix="nm"),
    ),
    kernel=_torque,
    may_push=True,
    formula="sine_nm * sin(angle_rad) + cosine_nm * cos(angle_rad)",
    never_separable={
        "quadratic_stiffness": COSINE,
        "cubic_stiffness": SINE,
    },
    as_rival={"cubic_stiffness": _as_cubic, "quadratic_stiffness": _as_quadratic},
    separated_by="from quadratic and cubic stiffness: turn the base of the platform, or swing farther",
)
