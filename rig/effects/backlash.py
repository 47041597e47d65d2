"""Backlash: a gap around zero in which the spring does not act."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return -p[2] * min(max(angle, -p[3]), p[3])


def _gaps(scale: Scale) -> tuple[float, ...]:
    return tuple(scale.angle_rad * f for f in (0.002, 0.01, 0.03, 0.1, 0.3))


EFFECT = Effect(
    name="backlash",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = -K * clip(th, -half_gap, half_gap): K th + T is zero inside the gap",
    source="Nordin and Gutman 2002, dead-zone model of backlash",
    meaning="Play in a coupling or gear: near zero angle no spring torque acts on the platform.",
    sign="The gap is symmetric about the zero of the encoder; with a gyro alone, about the rest angle before the run.",
    parameters=(Parameter("half_gap", "rad", "half of the play", low=0.0, high=10.0, suffix="rad", start=_gaps),),
    kernel=_torque,
    formula="-stiffness_nm_rad * fmin(fmax(angle_rad, -half_gap_rad), half_gap_rad)",
    kinks=lambda values: (-values[0], values[0]),
    leans_on=("stiffness",),
    rests_within_rad=lambda values: values[3],
    stays="the rest angle within the gap is not known before the run",
    separated_by="from cubic stiffness and cogging: excite at a small and at a large amplitude",
)
