"""Presliding friction (Dahl): before it slides, the contact bends like a spring."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    dstate[0] = (rate - abs(rate) * state[0]) / p[4]
    return p[3] * state[0]


def _displacements(scale: Scale) -> tuple[float, ...]:
    return tuple(scale.angle_rad * f for f in (0.002, 0.006, 0.02, 0.06, 0.2))


def _fastest(values: tuple[float, ...]) -> float:
    inertia, _, _, level, displacement = values
    # The bristles' spring, and their bending at 8 rad/s; a faster motion has bent them before a fine step ends.
    return max((abs(level) / displacement / inertia) ** 0.5, 0.5 / displacement)


EFFECT = Effect(
    name="presliding_friction",
    family="friction",
    place=Place.LOAD,
    equation="T = level * z, dz/dt = (w - |w| z) / displacement",
    source="Dahl 1968; LuGre (Canudas de Wit 1995) without Stribeck effect and micro-damping",
    meaning="Rolling and rubbing contacts that creep elastically before they slip; a hysteresis at reversals.",
    sign="Resisting: z follows the sign of the rate; K is the parallel spring alone.",
    parameters=(
        Parameter("level", "N*m", "sliding level", linear=True, suffix="nm"),
        Parameter(
            "displacement",
            "rad",
            "angle within which the level builds up",
            low=1e-5,
            high=10.0,
            suffix="rad",
            start=_displacements,
        ),
    ),
    kernel=_torque,
    states=1,
    fastest_rad_s=_fastest,
    follows_within_rad=lambda values: values[4],
    nests=("coulomb_friction",),
    separated_by="from Coulomb friction and hysteresis: repeats at a small amplitude",
)
