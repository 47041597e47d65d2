"""The inertia estimated from the response to a pulse, with friction, spring and delay unknown.

From rest, and while the motion lasts,

    J (w - w0) + K int(th - th0) + F int sgn(w) + c t = int M dt

whatever J, K and the friction F are; c takes up where the spring stood. So the inertia follows by least squares, once
for each delay that the torque may have; of what is declared only the largest stiffness is needed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rig.arrays import Array

DELAY_SHARE, DELAY_STEP_S = 0.6, 0.001  # of the pulse: how late the torque may act
NEAR_BEST_RATIO = 1.5  # ratio of residuals: fits "within half as much again" (decision 0016)
POOR_FIT = 0.3  # of the scatter of the impulse: beyond it a pulse does not count
MIN_PULSE_SAMPLES = 8  # for five unknowns


class InertiaRange(NamedTuple):
    """The inertia in kg m2 that fits best, and between which ones all lie that fit nearly as well."""

    best: float
    low: float
    high: float


def estimate_inertia(
    time_s: Array, rate_rad_s: Array, torque_nm: float, pulse_s: float, stiffest_nm_rad: float = math.inf
) -> InertiaRange | None:
    """Inertia from the answer to half a sine of this height that began at time zero; None if none fits.

    Parameters
    ----------
    time_s, rate_rad_s
        Shape (n,), increasing; the rate less its bias, turned so that torque and rate have one sign.
    stiffest_nm_rad
        No spring is stiffer. A short stroke between two stops of friction tells a later torque on a stiffer spring
        from an earlier one on a softer spring hardly at all, and the inertia with them.
    """
    moving = _while_it_moves(rate_rad_s)
    t, w = time_s[moving], rate_rad_s[moving]
    if len(t) < MIN_PULSE_SAMPLES:
        return None
    step = np.diff(t)
    angle = _integral(w, step)
    slow = 0.02 * float(np.max(np.abs(w)))
    columns = np.column_stack([
        w - w[0], _integral(angle, step), _integral(np.tanh(w / slow), step), t - t[0], t[0] - t,
    ])  # fmt: skip
    found = []
    for delay_s in np.arange(0.0, DELAY_SHARE * pulse_s, DELAY_STEP_S):
        y = _impulse(t - delay_s, torque_nm, pulse_s)
        y = y - y[0]
        size = max(float(np.std(y)), 1e-300) * math.sqrt(len(y))
        inertia, left = _solve_impulse_balance(columns, y, stiffest_nm_rad)
        found.append((left / size, inertia))
    least = min(left for left, _ in found)
    if least >= POOR_FIT:
        return None
    near = [inertia for left, inertia in found if left <= NEAR_BEST_RATIO * least]
    return InertiaRange(min(found)[1], min(near), max(near))


def _solve_impulse_balance(columns: Array, y: Array, stiffest: float) -> tuple[float, float]:
    """Inertia, stiffness and friction of one sign: else half a period of delay would pass for the other sign."""
    scale = np.maximum(np.max(np.abs(columns), axis=0), 1e-300)
    solved, left = nnls(columns / scale, y)
    if solved[1] <= stiffest * scale[1]:
        return float(solved[0] / scale[0]), float(left)
    others = [0, 2, 3, 4]
    solved, left = nnls(columns[:, others] / scale[others], y - stiffest * columns[:, 1])
    return float(solved[0] / scale[0]), float(left)


def initial_direction(rate: Array) -> float:
    """The direction in which it first moves: from rest that is the torque's, whatever holds or delays it."""
    begun = np.abs(rate) > 0.3 * float(np.max(np.abs(rate))) + 1.5 * abs(float(rate[0]))
    return float(np.sign(rate[int(np.argmax(begun))]))


def _while_it_moves(rate: Array) -> slice:
    """From the first motion to where it sticks again, if it does."""
    peak = float(np.max(np.abs(rate)))
    fast = np.abs(rate) > 0.03 * peak
    first = max(int(np.argmax(fast)) - 2, 0)
    still = 0
    for i in range(int(np.argmax(np.abs(rate))), len(rate)):
        still = 0 if fast[i] else still + 1
        if still >= 5:
            return slice(first, i - 4)
    return slice(first, len(rate))


def _integral(y: Array, step: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * step)])


def _impulse(time_s: Array, torque_nm: float, pulse_s: float) -> Array:
    """Integral of half a sine from its beginning."""
    x = np.clip(time_s / pulse_s, 0.0, 1.0)
    return torque_nm * pulse_s / math.pi * (1.0 - np.cos(math.pi * x))
