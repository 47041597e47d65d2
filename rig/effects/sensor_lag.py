"""Sensor lag: the gyro's own low-pass filter."""

from __future__ import annotations

from rig.effects._first_order import lag, remembers, times
from rig.effects.base import Alike, Effect, Parameter, Place

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
            start=times,
        ),
    ),
    kernel=lag,
    filter_states=remembers,
    never_separable={
        "actuator_lag": Alike(
            "a lag in the gyro and a lag in the torque answer alike", cure="measure the current, or use a second sensor"
        )
    },
    separated_by="from a delay: higher frequencies",
)
