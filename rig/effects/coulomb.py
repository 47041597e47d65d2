"""Coulomb friction: a constant level that opposes the motion and holds the platform at rest."""

from __future__ import annotations

from rig.effects.base import Effect, LargeStart, Parameter, Place, Scale, kernel

# Factors on the fitted level from which the fit is started again: a fit in which the platform never sticks may end at
# a level that is far too low.
START_FACTORS = (3.0, 8.0)


@kernel
def _level(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3]


def _others(jck: tuple[float, float, float], own: tuple[float, ...], scale: Scale) -> tuple[LargeStart, ...]:
    return tuple(LargeStart({}, {"level": factor * own[0]}) for factor in START_FACTORS)


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
    formula="level_nm",
    other_minima=_others,
    rests_within_rad=lambda values: values[3] / values[2] if values[2] > 0.0 else 0.0,
    stays="friction holds the platform anywhere within a band, so its rest angle is not known before the run",
    separated_by="from Stribeck and presliding friction: ramp slowly, hold and release; excite at several amplitudes",
)
