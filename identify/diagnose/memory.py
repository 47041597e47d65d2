"""What the residual owes to the present and what to the past: regressions that have to hold on samples not fitted.

The present is angle, rate and torque at the same instant, each with a free function. The past is what angle, rate
and torque were a while ago (creep, lags, a second mode) and which way the platform came over the last stretch of its
travel (a hysteresis loop). Past motion is the model's own: what was measured has felt every disturbance, and its
differences give the acceleration, with which any residual can be told from itself. Both are fitted on one half of the
blocks of every run and judged on the other: what is only noise explains nothing there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from rig.recording.run import Array

HAT_KNOTS = 9  # of a piecewise linear function, at even shares of the samples
MAX_MEMORY_ROWS = 16_000  # of all runs together: enough for some fifty columns
MEMORY_TIMES_S = (0.004, 0.02, 0.1, 0.5)  # time constants of first-order lags
PAST_TRAVEL = (0.02, 0.1, 0.4)  # of the travel
ALTERNATING_BLOCKS = 16  # a run; two folds take them in turn
MAX_PATH_STEPS = 400_000  # steps along the path of one run
MEMORY_RIDGE = 1e-7  # a sample, on columns scaled to a mean square of one
ANGLES = 16  # bins in which the two directions are compared
MIN_DIRECTION_BIN_SAMPLES = 8  # samples of either direction in a bin


@dataclass(frozen=True)
class RunResiduals:
    """One run: its motion, and residuals (n, m) of several models or of noise, side by side.

    ``angle_by_model`` and ``rate_by_model`` are zero where no model runs near the data.
    """

    step_s: float
    angle: Array
    rate: Array
    torque: Array
    angle_by_model: Array
    rate_by_model: Array
    use: NDArray[np.bool_]
    left: Array


def memory_power(runs: Sequence[RunResiduals]) -> Array:
    """Mean square of each residual, (m,), that the past explains beyond what the present does; negative by chance.

    The present is asked twice, as measured and as the model has it, and the lesser gain counts. Beside the model's
    past the measured present betrays what drives them apart (a spring that drifts); the model's own present is late
    or early at every reversal where friction acts.
    """
    thin = max(1, -(-sum(len(r.angle) for r in runs) // MAX_MEMORY_ROWS))
    rows = [np.flatnonzero(r.use)[::thin] for r in runs]
    fold = np.concatenate([at * ALTERNATING_BLOCKS // len(r.angle) % 2 for at, r in zip(rows, runs, strict=True)])

    def joined(of: str) -> Array:
        return np.concatenate([getattr(r, of)[at] for at, r in zip(rows, runs, strict=True)])

    travel = max(float(np.ptp(r.angle)) for r in runs)
    past = np.concatenate([_past(r, travel)[at] for at, r in zip(rows, runs, strict=True)])
    left, torque = joined("left"), joined("torque")
    gains = []
    for angle, rate in (("angle", "rate"), ("angle_by_model", "rate_by_model")):
        present = _present(joined(angle), joined(rate), torque)
        without = _left_square(present, left, fold)
        gains.append(without - _left_square(np.column_stack([present, past]), left, fold))
    return np.asarray(np.minimum(*gains))


def _present(angle: Array, rate: Array, torque: Array) -> Array:
    """Free functions of each quantity, and friction's corner at standstill at three scales, (n, k)."""
    ways = [np.tanh(rate / (q + 1e-300)) for q in np.quantile(np.abs(rate), (0.01, 0.04, 0.15))]
    alone = [hats(angle), hats(rate), hats(torque)]
    return np.column_stack([*alone, *ways, ways[0] * np.abs(torque), np.ones(len(rate))])


def _left_square(columns: Array, left: Array, fold: NDArray[np.intp]) -> Array:
    """Mean square that a regression fitted on the other fold leaves, (m,)."""
    scaled = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    square = np.zeros(left.shape[1])
    halves = [(scaled[fold == k], left[fold == k]) for k in (0, 1)]
    normal = [(c.T @ c, c.T @ y) for c, y in halves]
    for k, (c, y) in enumerate(halves):
        gram, moment = normal[1 - k]
        found = np.linalg.solve(gram + MEMORY_RIDGE * len(left) * np.eye(len(gram)), moment)
        square += np.sum((y - c @ found) ** 2, axis=0)
    return np.asarray(square / len(left))


def _past(run: RunResiduals, travel: float) -> Array:
    """What was a while ago, (n, k), less what is now."""
    moved = (run.angle_by_model, run.rate_by_model, run.torque)
    columns = [delayed(x, tau, run.step_s) - x for x in moved for tau in MEMORY_TIMES_S]
    return np.column_stack([*columns, *(came_from(run.angle_by_model, share * travel) for share in PAST_TRAVEL)])


def hats(x: Array, knots: int = HAT_KNOTS) -> Array:
    """Piecewise linear functions of x, (n, knots - 1): any continuous function, less its constant."""
    at = np.unique(np.quantile(x, np.linspace(0.0, 1.0, knots)))
    if len(at) < 3:
        return x[:, None]
    place = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
    part = (x - at[place]) / (at[place + 1] - at[place])
    out = np.zeros((len(x), len(at)))
    rows = np.arange(len(x))
    out[rows, place] = 1.0 - part
    out[rows, place + 1] = part
    return out[:, 1:]


def delayed(x: Array, time_constant_s: float, step_s: float) -> Array:
    """x behind a first-order lag that begins at rest at its first value, (n,)."""
    keep = float(np.exp(-step_s / time_constant_s))
    return np.asarray(signal.lfilter([1.0 - keep], [1.0, -keep], x - x[0])) + x[0]


def came_from(angle: Array, length: float) -> Array:
    """Direction of the travel, averaged over the last ``length`` of it, (n,): which way the angle was reached."""
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))])
    if path[-1] < length or length <= 0.0:
        return np.zeros_like(angle)
    step = max(length / 12.0, float(path[-1]) / MAX_PATH_STEPS)
    even = np.arange(0.0, path[-1] + step, step)
    where = np.interp(even, path, angle)
    keep = float(np.exp(-step / length))
    lagged = signal.lfilter([1.0 - keep], [1.0, -keep], np.diff(where, prepend=where[0]) / step)
    return np.asarray(np.interp(path, even, lagged))


def direction_power(runs: Sequence[RunResiduals]) -> Array:
    """Mean square of each residual, (m,), that changes sign with the direction of motion at the same angle.

    Half the difference of the two directions' means in bins of the angle, the product of two estimates from
    different halves of the blocks: noise shows nothing on average.
    """
    angle, rate = (np.concatenate([getattr(r, of)[r.use] for r in runs]) for of in ("angle", "rate"))
    left = np.concatenate([r.left[r.use] for r in runs])
    fold = np.concatenate([np.flatnonzero(r.use) * ALTERNATING_BLOCKS // len(r.angle) % 2 for r in runs])
    edges = np.unique(np.quantile(angle, np.linspace(0.0, 1.0, ANGLES + 1)))
    bins = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, ANGLES - 1)
    cell = bins + ANGLES * (rate > 0.0) + 2 * ANGLES * fold
    count = np.bincount(cell, minlength=4 * ANGLES)
    sums = np.column_stack([np.bincount(cell, y, minlength=4 * ANGLES) for y in left.T])
    mean = (sums / np.maximum(count, 1)[:, None]).reshape(2, 2, ANGLES, -1)
    known = np.all(count.reshape(4, ANGLES) >= MIN_DIRECTION_BIN_SAMPLES, axis=0)
    half = 0.5 * (mean[:, 1] - mean[:, 0])  # fold, bin, residual
    weight = np.where(known, np.bincount(bins, minlength=ANGLES), 0.0) / len(angle)
    return np.asarray(weight @ (half[0] * half[1]))
