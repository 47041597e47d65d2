"""Load-dependent friction: a friction level proportional to the torque on the shaft."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _level(angle, speed, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * abs(torque)


EFFECT = Effect(
    name="load_dependent_friction",
    family="friction",
    place=Place.FRICTION,
    equation="T = factor * |M| * sgn(w)",
    source="gear and bearing friction: Hamon, Gautier, Garrec 2010, load-dependent Coulomb friction",
    meaning="Gears and loaded bearings: the transmitted torque presses the sliding surfaces together.",
    sign="Resisting: it opposes the rate.",
    parameters=(Parameter("factor", "1", "friction torque over transmitted torque", linear=True, high=0.95),),
    kernel=_level,
    formula="factor * fabs(torque_nm)",
    stays="friction holds the platform anywhere within a band, so its rest angle is not known before the run",
    separated_by="from Coulomb friction: repeat at another amplitude",
)
