"""The first-order lag that the drive and the sensor share."""

from __future__ import annotations

import math

from rig.effects.base import Scale, filter_kernel


@filter_kernel
def lag(x, step, state, p):  # type: ignore[no-untyped-def]
    """First-order lag, exact for an input that follows a parabola through the last three samples.

    A straight line between them is too low by (w h)^2 / 12, which is seen in J and K where the sensor is good.
    """
    tau = p[0]
    if tau <= 1e-9:
        return x
    a = math.exp(-step / tau)
    ramp = 1.0 - tau / step * (1.0 - a)
    y = a * state[0] + (1.0 - a - ramp) * state[1] + ramp * x
    bend = (x - 2.0 * state[1] + state[2]) / (2.0 * step * step)
    y += bend * (tau * (2.0 * tau - step) - a * tau * (step + 2.0 * tau))
    state[0] = y
    state[2] = state[1]
    state[1] = x
    return y


def remembers(step_s: float, values: tuple[float, ...]) -> int:
    """How many numbers the lag keeps: its output and two samples."""
    return 3


def times(scale: Scale) -> tuple[float, ...]:
    """Time constants to begin from."""
    return tuple(scale.step_s * f for f in (0.3, 1.0, 3.0, 10.0))
