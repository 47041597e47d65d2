"""Torque delay: the torque acts later than its time stamp says, or the rate is stamped too late."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.effects.base import Effect, Parameter, Place, filter_kernel


@filter_kernel
def _delay(x, step, state, p):  # type: ignore[no-untyped-def]
    """Ring buffer, read by a cubic through four samples: relative error 1e-7 for the torques of a bench."""
    late = p[0] / step
    n = int(late) + 5
    head = (int(state[n]) + 1) % n
    state[n] = head
    state[head] = x
    first = max(0, int(late) - 1)  # the newest of the four samples
    u = late - first
    x0 = state[(head - first) % n]
    x1 = state[(head - first - 1) % n]
    x2 = state[(head - first - 2) % n]
    x3 = state[(head - first - 3) % n]
    return (
        x0 * (1.0 - u) * (2.0 - u) * (3.0 - u) / 6.0
        + x1 * u * (2.0 - u) * (3.0 - u) / 2.0
        - x2 * u * (1.0 - u) * (3.0 - u) / 2.0
        + x3 * u * (1.0 - u) * (2.0 - u) / 6.0
    )


def _earlier(torque_nm: Array, step_s: float, values: tuple[float, ...]) -> Array:
    """The torque asked for by the delay earlier; nothing is wanted behind the last value."""
    time_s = step_s * np.arange(len(torque_nm))
    return np.interp(time_s + values[0], time_s, torque_nm, right=0.0)


EFFECT = Effect(
    name="torque_delay",
    family="drive",
    place=Place.DRIVE,
    equation="M(t) = torque(t - delay)",
    source="transport delay of bus, amplifier and sensor: torque and rate show only their sum",
    meaning="The torque acts later than its time stamp says, or the rate is stamped late: the delays of bus, amplifier "
    "and gyro add up. If it is not modelled, C is too large by K times the delay at frequencies well below resonance.",
    sign="Positive: the motion follows the recorded torque later than the model without a delay says.",
    parameters=(
        Parameter(
            "delay",
            "s",
            "time by which the torque acts later than recorded",
            low=0.0,
            high=0.2,
            suffix="s",
            start=lambda scale: tuple(scale.step_s * f for f in (0.3, 1.0, 3.0)),
        ),
    ),
    kernel=_delay,
    filter_states=lambda step_s, values: int(values[0] / step_s) + 6,
    inverse=_earlier,
    delay_s=lambda values: values[0],
    ahead_s=lambda values: values[0],
    separated_by="from damping: excite at several frequencies; from a lag: excite at higher frequencies",
)
