"""Load-dependent friction: a level that grows with the torque that passes through."""

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
    meaning="Gears and loaded bearings: the transmitted torque presses the rubbing surfaces together.",
    sign="Resisting: it opposes the rate.",
    parameters=(Parameter("factor", "1", "friction per transmitted torque", linear=True, high=0.5),),
    kernel=_level,
    separated_by="from Coulomb friction: repeats at another amplitude",
)
