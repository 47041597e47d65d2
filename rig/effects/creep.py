"""Creep (standard linear solid): a spring that relaxes under load."""

from __future__ import annotations

import math

from rig.effects.base import Effect, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    dstate[0] = (angle - state[0]) / p[4]
    return p[3] * (angle - state[0])


def _times(scale: Scale) -> tuple[float, ...]:
    slowest = 0.5 * scale.duration_s
    fastest = max(8.0 * scale.step_s, 0.3 / max(2.0 * math.pi * scale.natural_frequency_hz, 1e-3))
    count = 7
    return tuple(fastest * (slowest / fastest) ** (i / (count - 1)) for i in range(count))


EFFECT = Effect(
    name="creep",
    family="restoring torque",
    place=Place.LOAD,
    equation="T = stiffness * (th - z), dz/dt = (th - z) / time",
    source="Zener 1948, standard linear solid (Maxwell branch beside the spring)",
    meaning="Elastomers and adhesives yield slowly under load.",
    sign="Resisting, like K th; K is the stiffness after relaxation.",
    parameters=(
        Parameter("stiffness", "N*m/rad", "additional stiffness that relaxes", linear=True, suffix="nm_rad"),
        Parameter("time", "s", "relaxation time", low=1e-5, high=1e4, suffix="s", start=_times),
    ),
    kernel=_torque,
    states=1,
    has_linear_states=True,
    rest_state=lambda angle, rate: (angle,),
    fastest_rad_s=lambda values: 0.3 / values[4],
    is_flexible=True,
    relaxes="time",
    goes_with=("history",),
    separated_by="from damping: excite at several frequencies; from stiffness drift: hold a constant torque",
)
