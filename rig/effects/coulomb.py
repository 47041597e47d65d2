"""Coulomb friction: a constant level that opposes the motion and holds the platform at rest."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _level(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3]


EFFECT = Effect(
    name="coulomb_friction",
    family="friction",
    place=Place.FRICTION,
    equation="T = level * sgn(w); at w = 0 it takes any value up to level",
    source="Eq. 7 of the paper with M_s = M_c; Coulomb 1785",
    meaning="Dry friction of bearings, slip rings and seals.",
    sign="Resisting: it opposes the rate.",
    parameters=(Parameter("level", "N*m", "friction level", linear=True, suffix="nm"),),
    kernel=_level,
    separated_by="from Stribeck and presliding friction: slow ramp, hold and release; several amplitudes",
)
