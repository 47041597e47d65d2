"""A gyro beyond its full scale: it goes on reporting its largest rate while the platform turns faster.

A record tells of it by plateaus that are cut off: sample after sample at exactly the largest value, entered and left
steeply. A slow turn read in coarse steps has such plateaus too, but it enters and leaves them by a step or two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.recording.run import Array

MIN_PLATEAU_SAMPLES = 3  # samples that are equal to the last bit
MIN_PLATEAUS = 3  # plateaus in all runs: what is cut off once may be something else
MIN_CUT_OFF_STEPS = 5.0  # of the sensor's resolution that a plateau cuts off at least
CURVE = 4.0  # a parabola of slope s at both ends and length n is s * n / 4 high


def full_scale_of(rates: Sequence[Array]) -> tuple[float, float]:
    """The lowest and highest rate that the gyro of these runs can report; infinite where none shows.

    Parameters
    ----------
    rates
        One array (n,) a run, of the samples that are there; in any unit.
    """
    (bottom, below), (top, above) = (_ceiling([sign * rate for rate in rates]) for sign in (-1.0, 1.0))
    shows = below + above >= MIN_PLATEAUS
    return (-bottom if shows and below else -np.inf), (top if shows and above else np.inf)


def _ceiling(rates: Sequence[Array]) -> tuple[float, int]:
    """The largest value of all runs, and how many plateaus it cuts off."""
    top = max((float(np.max(rate)) for rate in rates if len(rate)), default=np.inf)
    return top, sum(_plateaus(rate, top) for rate in rates)


def _plateaus(rate: Array, top: float) -> int:
    """How many plateaus at that value cut off more than the sensor's resolution tells."""
    steps = np.abs(np.diff(rate))
    resolution = float(np.min(steps[steps > 1e-9 * abs(top)], initial=np.inf))
    edges = np.diff(np.concatenate([[0], (rate == top).astype(np.int8), [0]]))
    count = 0
    for first, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        length = int(end - first)
        reach = max(1, length // 4)
        if length < MIN_PLATEAU_SAMPLES or first < reach + 1 or end + reach >= len(rate):
            continue
        up = (rate[first - 1] - rate[first - 1 - reach]) / reach
        down = (rate[end] - rate[end + reach]) / reach
        count += int(min(up, down) * length / CURVE > MIN_CUT_OFF_STEPS * resolution)
    return count


def describe(runs: Sequence[tuple[str, int, float]], axis: str) -> str:
    """One sentence on the runs (name, samples at the full scale, that rate in rad/s or m/s); empty where none has any.

    Parameters
    ----------
    axis
        "rotary" or "linear".
    """
    linear = axis == "linear"
    each = [
        f"{name} ({count} samples at {rate if linear else np.degrees(rate):.4g} {'m/s' if linear else 'deg/s'})"
        for name, count, rate in runs if count
    ]  # fmt: skip
    if not each:
        return ""
    left_out = ", ".join(each)
    return f"Samples at the sensor's full scale are excluded, because the platform moved faster: {left_out}"
