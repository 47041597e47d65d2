"""Stribeck friction (Eq. 7): static friction that falls to the Coulomb level as the speed rises."""

from __future__ import annotations

import math

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _level(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] + (p[4] - p[3]) * math.exp(-((speed / p[5]) ** 2))


def _speeds(scale: Scale) -> tuple[float, ...]:
    return tuple(scale.rate_rad_s * f for f in (0.003, 0.01, 0.03, 0.1, 0.3))


EFFECT = Effect(
    name="stribeck_friction",
    family="friction",
    place=Place.FRICTION,
    equation="T = [coulomb + (static - coulomb) exp(-(w / speed)^2)] sgn(w)",
    source="Eq. 7 of the paper; its viscous term sigma w is collinear with C w and is part of C",
    meaning="Lubricated contacts: breaking away takes more torque than sliding.",
    sign="Resisting: it opposes the rate; static is at least coulomb.",
    parameters=(
        Parameter("coulomb", "N*m", "level at high speed (M_c)", linear=True, suffix="nm"),
        Parameter("static", "N*m", "level at rest (M_s)", linear=True, suffix="nm"),
        Parameter("speed", "rad/s", "Stribeck speed (w_s)", low=1e-4, suffix="rad_s", start=_speeds),
    ),
    kernel=_level,
    formula="coulomb_nm + (static_nm - coulomb_nm) * exp(-(rate_rad_s / speed_rad_s) * (rate_rad_s / speed_rad_s))",
    ordered=(("coulomb", "static"),),
    nests=("coulomb_friction",),
    from_special={"coulomb_friction": lambda v: {"coulomb": v[0], "static": v[0]}},
    rests_within_rad=lambda values: values[3] / values[2] if values[2] > 0.0 else 0.0,
    stays="friction holds the platform anywhere within a band, so its rest angle is not known before the run",
    separated_by="from Coulomb friction: spend more time at low speed; ramp slowly, hold and release",
)
