"""Corrected time stamps: how they are stored in a journal and applied.

While it plays, a sample is stamped by what is known of the device's clock until then. When the campaign is over the
rig may know better; then one event a set holds the points of a piecewise straight map from the recorded times to the
better ones. The tables of the journal stay as they were written, and so a campaign that was killed has none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.arrays import Array

BEGUN_S = "begun_s"
EVENT_KEY = "restamped"
MAX_POINTS = 10_000_000
MAX_STEP_S = 1.0  # what a file says must not turn a recording upside down


class Retiming(NamedTuple):
    """Of one run: points (recorded, bettered), shape (2, n), in seconds since it began; None where nothing changes."""

    samples: Array | None = None
    torque: Array | None = None


NO_RETIMING = Retiming()


def retiming_of(start_s: float, samples: Sequence[Sequence[float]], torque: Sequence[Sequence[float]]) -> Retiming:
    """From points on the clock of the campaign, of a set that began at ``start_s``.

    Raises ValueError where the points are no map of times to times in the same order.
    """
    return Retiming(_points(samples, start_s), _points(torque, start_s))


def _points(pairs: Sequence[Sequence[float]], start_s: float) -> Array | None:
    points = np.array(pairs, dtype=float) - start_s
    if points.size == 0:
        return None
    if points.ndim != 2 or len(points) != 2 or points.size > MAX_POINTS or not np.all(np.isfinite(points)):
        raise ValueError("points of a map of times are two rows of finite numbers")
    if np.any(np.diff(points, axis=1) <= 0.0) or np.any(np.abs(points[1] - points[0]) > MAX_STEP_S):
        raise ValueError("a map of times keeps their order, and moves none by more than a second")
    return points


def event_values(start_s: float, found: Retiming) -> dict[str, Any]:
    """What an event of the journal says."""
    return {
        EVENT_KEY: True,
        BEGUN_S: start_s,
        "samples": [] if found.samples is None else found.samples.tolist(),
        "torque": [] if found.torque is None else found.torque.tolist(),
    }


def retiming_from_event(values: Mapping[str, Any]) -> tuple[float, Retiming] | None:
    """(when its run began, the points) from the values of an event; None where it is another one, or nonsense.

    The recorded times are sound without it, so nonsense here costs no sample.
    """
    if not isinstance(values, Mapping) or values.get(EVENT_KEY) is not True:
        return None
    try:
        return float(values[BEGUN_S]), retiming_of(0.0, values["samples"], values["torque"])
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def retimed(time_s: Array, points: Array | None) -> Array:
    """Times, shape (n,), moved as the points say; those outside as the first or the last."""
    if points is None:
        return time_s
    return np.asarray(time_s + np.interp(time_s, points[0], points[1] - points[0]))
