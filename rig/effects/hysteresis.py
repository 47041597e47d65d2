"""Hysteresis (Bouc-Wen): a restoring torque that depends on where the motion last reversed."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    z = state[0]
    # |z| <= 1, but a stage of an integration step may exceed it: there the power is continued by its tangent.
    beyond = max(abs(z) - 1.0, 0.0)
    size = min(abs(z), 1.0) ** p[5] + p[5] * beyond
    same = 1.0 if rate * z > 0.0 else -1.0
    dstate[0] = rate / p[4] * (1.0 - size * (p[6] * same + 1.0 - p[6]))
    return p[3] * z


def _yield_angles(scale: Scale) -> tuple[float, ...]:
    return tuple(scale.angle_rad * f for f in (0.05, 0.15, 0.4, 1.0))


def _fastest(values: tuple[float, ...]) -> float:
    inertia, _, _, level, yield_angle, _, _ = values
    return max((abs(level) / yield_angle / inertia) ** 0.5, 0.5 / yield_angle)


EFFECT = Effect(
    name="hysteresis",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = level * z, dz/dt = w / yield_angle * [1 - |z|^exponent (share * sgn(w z) + 1 - share)]",
    source="Bouc 1967, Wen 1976, with z scaled to its limit: share = beta / (beta + gamma)",
    meaning="Wire-rope isolators, elastomers and flexures with internal slip: torque over angle is a loop.",
    sign="Resisting, like K th; K is the spring beside the loop.",
    parameters=(
        Parameter("level", "N*m", "torque at which the loop saturates", linear=True, suffix="nm"),
        Parameter(
            "yield_angle",
            "rad",
            "angle within which the loop builds up",
            low=1e-5,
            high=10.0,
            suffix="rad",
            start=_yield_angles,
        ),
        Parameter("exponent", "1", "sharpness of the knee", low=1.0, high=6.0, start=lambda scale: (1.0, 2.0)),
        Parameter("share", "1", "shape: beta / (beta + gamma)", low=0.0, high=1.0, start=lambda scale: (0.5,)),
    ),
    kernel=_torque,
    states=1,
    fastest_rad_s=_fastest,
    follows_within_rad=lambda values: values[4] / values[5],
    nests=("presliding_friction",),
    from_special={"presliding_friction": lambda v: {"level": v[0], "yield_angle": v[1], "exponent": 1.0, "share": 1.0}},
    is_flexible=True,
    goes_with=("history", "direction"),
    stays="the deflection at which a run finds it is computed from the run before: a touch in between changes it",
    separated_by="from presliding friction: repeat at several amplitudes",
)
