"""Sensor lag of second order: the low-pass of a gyro as its data sheet has it."""

from __future__ import annotations

import math

from rig.effects._first_order import times
from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _low_pass(x, step, state, p):  # type: ignore[no-untyped-def]
    """Butterworth low-pass of second order, exact for an input that runs straight between two samples.

    State: output, its slope over the corner frequency, the last input.
    """
    root = math.sqrt(2.0)
    if p[0] <= 0.0:
        state[0], state[1], state[2] = x, 0.0, x
        return x
    corner = root / p[0]
    u = corner * step / root
    decay, c, s = math.exp(-u), math.cos(u), math.sin(u)
    # Behind a straight line the output runs along it, late by the time p[0].
    slope = (x - state[2]) / step
    late = state[2] - slope * p[0]
    y, dy = state[0] - late, state[1] - slope / corner
    state[0] = decay * ((c + s) * y + root * s * dy) + late + slope * step
    state[1] = decay * ((c - s) * dy - root * s * y) + slope / corner
    state[2] = x
    return state[0]


EFFECT = Effect(
    name="sensor_lag_second_order",
    family="sensor",
    place=Place.SENSOR,
    equation="time^2 / 2 * d2y/dt2 + time * dy/dt + y = w, y the measured rate",
    source="Butterworth low-pass of second order; its -3 dB frequency in a data sheet is 1 / (sqrt(2) pi time)",
    meaning="The gyro or its output filter has a limited bandwidth.",
    sign="Never negative: the measured rate follows later than w.",
    parameters=(
        Parameter("time", "s", "by how much later slow motion is read", low=0.0, high=0.5, suffix="s", start=times),
    ),
    kernel=_low_pass,
    filter_states=lambda step_s, values: 3,
    lag=lambda values: (values[0], 0.5 * values[0] ** 2),
    stays="it changes the measurement, not the motion: the linear model is measured through the same lag",
    separated_by="from a delay: excite at higher frequencies",
)
