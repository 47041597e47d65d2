"""Flexible mode: a second inertia, coupled to the shaft by a spring and a damper."""

from __future__ import annotations

import math

from rig.effects.base import Effect, LargeStart, Parameter, Place, Scale, kernel

LIGHT, QUARTER, HEAVY = 0.03, 0.25, 0.5  # share of the second inertia in the total inertia


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    natural = 2.0 * math.pi * p[4]
    pull = natural * natural * (angle - state[0]) + 2.0 * p[5] * natural * (rate - state[1])
    dstate[0] = state[1]
    dstate[1] = pull
    return p[3] * pull


def _frequencies(scale: Scale) -> tuple[float, ...]:
    highest = 0.35 / scale.step_s
    lowest = max(0.5, 2.0 / scale.duration_s)
    count = 20
    return (*(lowest * (highest / lowest) ** (i / (count - 1)) for i in range(count)), *scale.modes_hz)


def _large(jck: tuple[float, float, float], scale: Scale) -> tuple[LargeStart, ...]:
    """A quarter of the inertia on a mode somewhat above the natural frequency: in slow motion both move as one."""
    inertia, _, stiffness = jck
    if stiffness <= 0.0:
        return ()
    natural_hz = scale.natural_frequency_hz
    own = {"inertia": QUARTER * inertia, "ratio": 0.02}
    return tuple(
        LargeStart({"inertia": (1.0 - QUARTER) * inertia}, {**own, "frequency": n * natural_hz}) for n in (1.2, 1.8)
    )


def _others(jck: tuple[float, float, float], own: tuple[float, ...], scale: Scale) -> tuple[LargeStart, ...]:
    """Other modes with nearly the same response at low frequency, from which the fit is started again.

    An excitation below the mode determines only the sum of the inertias and inertia / frequency^2. A lightly damped
    mode above all excitation shows only in the transient at the beginning of a run, at the frequency at which the two
    inertias swing against each other with the shaft free.
    """
    inertia, frequency, ratio = own
    both, out = jck[0] + inertia, []
    for ring in scale.rings_hz:
        for share in (LIGHT, QUARTER, HEAVY):
            mine = {"inertia": share * both, "frequency": ring * math.sqrt(1.0 - share), "ratio": 0.02}
            out.append(LargeStart({"inertia": (1.0 - share) * both}, mine))
    for times in (0.6, 1.6, 2.5):
        heavier = times**2 * inertia
        if heavier - inertia < 0.5 * jck[0]:
            mine = {"inertia": heavier, "frequency": times * frequency, "ratio": ratio}
            out.append(LargeStart({"inertia": both - heavier}, mine))
    return tuple(out)


EFFECT = Effect(
    name="flexible_mode",
    family="structure",
    place=Place.LOAD,
    equation="T = inertia * x, x = d2q/dt2 = W^2 (th - q) + 2 ratio W (w - dq/dt), W = 2 pi frequency, q: its angle",
    source="two-inertia system; Ewins, Modal Testing",
    meaning="A payload or arm on a soft mount adds a second resonance.",
    sign="J is the inertia fixed to the shaft; the effect adds the second inertia.",
    parameters=(
        Parameter("inertia", "kg*m^2", "second inertia", linear=True, suffix="kg_m2"),
        Parameter(
            "frequency",
            "Hz",
            "its natural frequency with the shaft held",
            low=0.05,
            high=1e5,
            suffix="hz",
            start=_frequencies,
        ),
        Parameter("ratio", "1", "its damping ratio", low=1e-4, high=2.0, start=lambda scale: (0.03,)),
    ),
    kernel=_torque,
    states=2,
    has_linear_states=True,
    rest_state=lambda angle, rate: (angle, rate),
    fastest_rad_s=lambda values: 2.0 * math.pi * values[4] * (1.0 + values[3] / values[0]) ** 0.5,
    large_starts=_large,
    is_flexible=True,
    other_minima=_others,
    separated_by="from inertia: excite with a multisine or chirp, below and above the frequency of the mode",
)
