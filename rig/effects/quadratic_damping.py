"""Quadratic damping: drag that grows with the square of the speed."""

from __future__ import annotations

from rig.effects.base import Effect, Parameter, Place, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    return p[3] * rate * abs(rate)


EFFECT = Effect(
    name="quadratic_damping",
    family="friction",
    place=Place.LOAD,
    equation="T = factor * w |w|",
    source="turbulent drag; ISO 80000-11 drag factor",
    meaning="Drag of air or of churned oil: it grows with the square of the speed.",
    sign="Resisting: it opposes the rate.",
    parameters=(Parameter("factor", "N*m*s^2/rad^2", "drag factor", linear=True, suffix="nm_s2_rad2"),),
    kernel=_torque,
    formula="factor_nm_s2_rad2 * fabs(rate_rad_s) * rate_rad_s",
    separated_by="from damping: repeat at another amplitude, or record a free decay",
)
