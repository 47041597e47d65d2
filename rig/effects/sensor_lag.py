"""Sensor lag: the gyro's own low-pass filter."""

from __future__ import annotations

import math

from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _lag(x, step, state, p):  # type: ignore[no-untyped-def]
    """First-order lag, exact for an input that runs linearly between samples."""
    tau = p[0]
    if tau <= 1e-9:
        return x
    a = math.exp(-step / tau)
    ramp = 1.0 - tau / step * (1.0 - a)
    y = a * state[0] + (1.0 - a - ramp) * state[1] + ramp * x
    state[0] = y
    state[1] = x
    return y


EFFECT = Effect(
    name="sensor_lag",
    family="sensor",
    place=Place.SENSOR,
    equation="time * d(rate)/dt + rate = rate before the lag",
    source="first-order low-pass; its -3 dB frequency in a data sheet is 1 / (2 pi time)",
    meaning="The bandwidth of the gyro or of its output filter.",
    sign="A time constant, never negative.",
    parameters=(
        Parameter(
            "time",
            "s",
            "time constant",
            low=0.0,
            high=0.5,
            suffix="s",
            start=lambda scale: tuple(scale.step_s * f for f in (0.3, 1.0, 3.0, 10.0)),
        ),
    ),
    kernel=_lag,
    filter_states=lambda step_s, values: 2,
    never_separable={
        "actuator_lag": "a lag in the gyro and a lag in the torque answer alike; "
        "measure the current, or use a second sensor"
    },
    separated_by="from a delay: higher frequencies",
)
