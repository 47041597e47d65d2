"""The first-order lag that the drive and the sensor share."""

from __future__ import annotations

import math

from rig.effects.base import Scale, filter_kernel


@filter_kernel
def lag(x, step, state, p):  # type: ignore[no-untyped-def]
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


def times(scale: Scale) -> tuple[float, ...]:
    """Time constants to begin from."""
    return tuple(scale.step_s * f for f in (0.3, 1.0, 3.0, 10.0))
