"""Actuator lag: the torque follows the recorded torque through a first-order low-pass."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.effects._first_order import lag, remembers, times
from rig.effects.base import Alike, Effect, Parameter, Place


def _led(torque_nm: Array, step_s: float, values: tuple[float, ...]) -> Array:
    """The equation of the lag, read from the right: torque + time * its slope."""
    return torque_nm + values[0] * np.gradient(torque_nm, step_s)


EFFECT = Effect(
    name="actuator_lag",
    family="drive",
    place=Place.DRIVE,
    equation="time * dM/dt + M = torque",
    source="first-order low-pass; electric time constant L_a / R_m of Fig. 2-3 of the paper",
    meaning="The motor current lags its set value: L/R of the winding, or the bandwidth of the current loop.",
    sign="Never negative: M follows later than the recorded torque.",
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
            "a lag in the torque and an equal one in the gyro give the same response from torque to rate",
            cure="measure the motor current, or add a second sensor",
        )
    },
    inverse=_led,
    delay_s=lambda values: values[0],
    spreads=True,
    is_first_order_lag=True,
    separated_by="from a delay: excite at higher frequencies",
)
