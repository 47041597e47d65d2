"""Actuator lag: the current follows its command through the winding's time constant."""

from __future__ import annotations

from rig.effects._first_order import lag, remembers, times
from rig.effects.base import Alike, Effect, Parameter, Place

EFFECT = Effect(
    name="actuator_lag",
    family="drive",
    place=Place.DRIVE,
    equation="time * d(torque)/dt + torque = torque before the lag",
    source="first-order low-pass; electric time constant L_a / R_m of Fig. 2-3",
    meaning="An amplifier without (or with a slow) current loop: L/R, or the loop's own bandwidth.",
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
        "sensor_lag": Alike(
            "a lag in the torque and a lag in the gyro answer alike", cure="measure the current, or use a second sensor"
        )
    },
    separated_by="from a delay: higher frequencies",
)
