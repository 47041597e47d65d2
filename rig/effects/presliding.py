"""Presliding friction (Dahl): before it slides, the contact deforms like a spring."""

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
    # The natural frequency of J on the stiffness of the contact; and fine steps in which a platform at 8 rad/s moves by
    # at most ``displacement``. A faster one bends the contact within a step: follows_within_rad bounds its state.
    return max((abs(level) / displacement / inertia) ** 0.5, 0.5 / displacement)


EFFECT = Effect(
    name="presliding_friction",
    family="friction",
    place=Place.LOAD,
    equation="T = level * z, dz/dt = (w - |w| z) / displacement",
    source="Dahl 1968; LuGre (Canudas de Wit 1995) without Stribeck effect and micro-damping",
    meaning="Rolling and sliding contacts deform elastically before they slip: a hysteresis at every reversal.",
    sign="Resisting: z follows the sign of the rate; K does not include the stiffness of the contact.",
    parameters=(
        Parameter("level", "N*m", "friction level once it slides", linear=True, suffix="nm"),
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
    stays="the deflection at which a run finds it is computed from the run before: a touch in between changes it",
    separated_by="from Coulomb friction and hysteresis: repeat at a small amplitude",
)
