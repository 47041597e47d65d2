"""The first-order lag that the drive and the sensor share."""

from __future__ import annotations

import math

from rig.effects.base import Scale, filter_kernel


@filter_kernel
def lag(x, step, state, p):  # type: ignore[no-untyped-def]
    """First-order lag, exact for an input that follows a parabola through the last three samples.

    With straight lines between the samples the gain would be too low by (w h)^2 / 12 (w: frequency in rad/s, h: step),
    which a low-noise sensor shows in J and K.
    """
    tau = p[0]
    if tau <= 0.0:  # however small it is, a fit has to see what a little more does
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
    """Number of states of the lag: its output and two input samples."""
    return 3


def times(scale: Scale) -> tuple[float, ...]:
    """Time constants from which the search starts."""
    return tuple(scale.step_s * f for f in (0.3, 1.0, 3.0, 10.0))
