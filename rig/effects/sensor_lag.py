"""Sensor lag: the low-pass filter in the gyro."""

from __future__ import annotations

from rig.effects._first_order import lag, remembers, times
from rig.effects.base import Alike, Effect, Parameter, Place

EFFECT = Effect(
    name="sensor_lag",
    family="sensor",
    place=Place.SENSOR,
    equation="time * d(measured rate)/dt + measured rate = w",
    source="first-order low-pass; its -3 dB frequency in a data sheet is 1 / (2 pi time)",
    meaning="The gyro or its output filter has a limited bandwidth.",
    sign="Never negative: the measured rate follows later than w.",
    parameters=(
        Parameter(
            "time",
            "s",
            "time constant",
            low=0.0,
            high=0.5,
            suffix="s",
            start=times,
        ),
    ),
    kernel=lag,
    filter_states=remembers,
    lag=lambda values: (values[0], 0.0),
    is_first_order_lag=True,
    never_separable={
        "actuator_lag": Alike(
            "a lag in the gyro and an equal one in the torque give the same response from torque to rate",
            cure="measure the motor current, or add a second sensor",
        )
    },
    stays="it changes the measurement, not the motion: the linear model is measured through the same lag",
    separated_by="from a delay: excite at higher frequencies",
)
