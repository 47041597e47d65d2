"""Periodic disturbance: a sinusoidal torque from outside, at a frequency of its own."""

from __future__ import annotations

import math

from rig.effects.base import Effect, LargeStart, Parameter, Place, Scale, kernel


@kernel
def _torque(angle, rate, time, torque, state, dstate, p):  # type: ignore[no-untyped-def]
    phase = 2.0 * math.pi * p[5] * time
    return p[3] * math.sin(phase) + p[4] * math.cos(phase)


def _frequencies(scale: Scale) -> tuple[float, ...]:
    return scale.lines_hz


def _large(jck: tuple[float, float, float], scale: Scale) -> tuple[LargeStart, ...]:
    """For a strong tone that a fit without it mistook for the resonance: start with a resonance elsewhere."""
    if scale.ringing_hz <= 0.0:
        return ()
    return tuple(LargeStart({"inertia": n * jck[0]}, {"frequency": scale.ringing_hz}) for n in (0.4, 2.5))


EFFECT = Effect(
    name="periodic_disturbance",
    family="surroundings",
    place=Place.LOAD,
    equation="T = sine * sin(2 pi frequency t) + cosine * cos(2 pi frequency t)",
    source="a spectral line that is not locked to the excitation",
    meaning="A torque from outside: pumps, fans, mains hum, machines nearby.",
    sign="Resisting; amplitude and phase are fitted in every run, t is counted from its start.",
    parameters=(
        Parameter("sine", "N*m", "sine part", linear=True, low=-float("inf"), suffix="nm", per_run=True),
        Parameter("cosine", "N*m", "cosine part", linear=True, low=-float("inf"), suffix="nm", per_run=True),
        Parameter("frequency", "Hz", "its frequency", low=0.01, high=1e5, suffix="hz", start=_frequencies),
    ),
    kernel=_torque,
    fastest_rad_s=lambda values: 2.0 * math.pi * values[5],
    large_starts=_large,
    is_flexible=True,
    goes_with=("time", "frequency"),
    repeats="frequency",
    foreseen=False,
    stays="its phase in a run is not known before it",
    separated_by=(
        "from harmonics of friction or stiffness: excite at other frequencies; from a spectral line of the sensor "
        "itself (an aliased vibration, pickup): switch the source on with the run, at rest, or add a known inertia in "
        "some runs; if the data show neither, the line is reported and its cause left open"
    ),
)
