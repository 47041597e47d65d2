"""Power of the residual at the multiples of the excitation, less what stands between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft

from identify.diagnose.memory import RunResiduals
from rig.recording.run import Array

RINGING_SHARE = 0.3  # of a run, left out where enough is left without it: there it still rings
PLAYED = 1e-4  # of the torque's power: a multiple with more was played
HIGHEST_MULTIPLE = 60  # multiples looked at
ORDERS = 11  # multiples whose powers are told one by one
BETWEEN = 12  # bins around a multiple that say what stands there anyway
HARMONIC_POWER_RATIO = 9.0  # times that


@dataclass(frozen=True)
class Repeated:
    """Powers (mean squares) of several residuals side by side, (m,) each, over all runs whose torque repeats."""

    total: Array
    own: Array
    odd: Array
    even: Array
    parted: bool  # the torque has no even multiples, so that odd and even tell a symmetric cause from another
    orders: dict[int, Array]


def harmonics(runs: Sequence[RunResiduals], periods: Sequence[float | None]) -> Repeated | None:
    """Sums over the runs; None where no torque repeats at least twice."""
    found = [one for run, period in zip(runs, periods, strict=True) if period for one in _of_run(run, period)]
    if not found:
        return None
    none = np.zeros(runs[0].left.shape[1])
    orders = {k: sum((f.orders.get(k, none) for f in found), none) for k in range(1, ORDERS + 1)}
    total, own, odd, even = (
        np.sum([getattr(f, of) for f in found], axis=0) for of in ("total", "own", "odd", "even")
    )  # fmt: skip
    return Repeated(total, own, odd, even, all(f.parted for f in found), orders)


def _of_run(run: RunResiduals, period_s: float) -> list[Repeated]:
    """One run's powers, weighed by its length; nothing where it holds less than two periods."""
    window = _whole_periods(run, period_s)
    if window is None:
        return []
    at, periods = window
    known = np.flatnonzero(run.use)
    values = np.array([np.interp(at, known, y[known]) for y in (run.torque, *run.left.T)])
    power = np.abs(fft.rfft(values - values.mean(axis=1, keepdims=True))).T ** 2 * (2.0 / len(at))
    torque, left = power[:, 0], power[:, 1:]
    highest = min(HIGHEST_MULTIPLE, (len(power) - 1) // periods)
    excess = np.array([_excess(left, k * periods, periods) for k in range(1, highest + 1)])
    at_multiples = torque[periods : highest * periods + 1 : periods]
    order = np.arange(1, highest + 1)
    played = at_multiples > PLAYED * np.sum(torque)
    odd = order % 2 == 1
    tone = bool(played[0]) and int(np.sum(played)) == 1
    return [
        Repeated(
            np.sum(left, axis=0), excess[played].sum(axis=0), excess[odd & ~played].sum(axis=0),
            excess[~odd & ~played].sum(axis=0), not np.any(played & ~odd),
            {int(k): excess[k - 1] for k in order[:ORDERS]} if tone else {},
        )
    ]  # fmt: skip


def _whole_periods(run: RunResiduals, period_s: float) -> tuple[Array, int] | None:
    """Places in samples, evenly spread over the last whole periods, and how many periods these are."""
    known = np.flatnonzero(run.use)
    length = period_s / run.step_s
    if len(known) < 2 or length < 4.0:
        return None
    span = float(known[-1] - known[0])
    periods = int((1.0 - RINGING_SHARE) * span / length)
    if periods < 2:
        periods = int(span / length)
    if periods < 2 or np.mean(run.use) < 0.5:
        return None
    count = periods * round(length)
    return known[-1] - length * periods * (1.0 - np.arange(count) / count), periods


def _excess(power: Array, at: int, periods: int) -> Array:
    """Power at a multiple above what its neighbours have, (m,); zero where it does not stand out."""
    reach = max(BETWEEN // 2 + 1, periods)
    around = np.arange(max(at - reach, 1), min(at + reach + 1, len(power)))
    around = around[around % periods != 0]
    anyway = np.mean(power[around], axis=0) if len(around) else np.zeros(power.shape[1])
    # The draws of noise know the slope of a drift.
    least = HARMONIC_POWER_RATIO * np.maximum(anyway, np.mean(power[at, 2:]))
    return np.where(power[at] > least, power[at] - anyway, 0.0)
