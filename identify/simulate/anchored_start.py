"""Where a gyro's angle begins anew in the middle of a run: where the spring holds what the torque and the motion leave.

The angle is integrated from the rate, and nobody knows how far the platform turned while readings were lost; bias and
stamps carry it away besides. A spring tells: over the first period behind a gap it pulls, on average, as much as
torque, inertia and damping leave to it. A linear platform forgets a wrong start within a few readings. One whose spring
stiffens is thrown by it.
"""

from __future__ import annotations

import numpy as np

from identify.signals.trace import UPSAMPLING
from identify.simulate.shots import RUNAWAY, Shots
from rig.arrays import Array
from rig.dynamics import Equations

LEAST_SAMPLES, MOST_SAMPLES = 8, 2000  # that a balance is taken over, where a period is shorter or longer than that
POINTS = 16  # of these, at which the pull is computed
NEWTON = 20  # steps to the angle
BESIDE_RAD = 1e-6  # for the slope of the pull


@RUNAWAY
def anchor(shots: Shots, equations: Equations) -> None:
    """Move start angles that are farther from the spring's balance than the platform swings, in place."""
    trace = shots.trace
    if not (trace.biased and trace.torque is not None and equations.jck[2] > 0.0):
        return
    anchored = np.zeros(len(shots.first), dtype=bool)
    for i, (begin, end) in enumerate(shots.edges):
        if begin * trace.step_s + trace.offset_s <= 0.0:  # where a run begins its angle counts from
            continue
        balance, swing = _balance_rad(shots, equations, begin, end)
        if np.isfinite(balance) and abs(balance - shots.starts[i, 0]) > swing:
            shots.starts[i, 0], anchored[i] = balance, True
    shots.anchored = anchored


def _balance_rad(shots: Shots, equations: Equations, begin: int, end: int) -> tuple[float, float]:
    """The start angle of a stretch by the balance of torques, and how far the platform swings there."""
    trace = shots.trace
    inertia, damping, stiffness = equations.jck.tolist()
    period = 2.0 * np.pi * np.sqrt(inertia / stiffness) / trace.step_s
    last = min(end - 1, begin + int(np.clip(period, LEAST_SAMPLES, MOST_SAMPLES)))
    if last - begin < LEAST_SAMPLES:
        return np.nan, np.inf
    angle, rate, _, torque = (x[begin * UPSAMPLING : last * UPSAMPLING + 1] for x in trace.fine[:4])
    span_s = (last - begin) * trace.step_s
    left = float(np.mean(torque)) - inertia * (rate[-1] - rate[0]) / span_s - damping * float(np.mean(rate))
    moved = np.interp(np.linspace(0.0, 1.0, POINTS), np.linspace(0.0, 1.0, len(angle)), angle - angle[0])
    swing = float(np.ptp(angle - np.linspace(angle[0], angle[-1], len(angle))))
    return _held_at(equations, moved, left), max(swing, float(np.ptp(moved)))


def _held_at(equations: Equations, moved: Array, torque_nm: float) -> float:
    """The angle from which a motion takes so much torque of spring and loads on average; NaN where none is found."""

    def pull(at: float) -> float:
        return float(np.mean([equations.pull_nm(at + x) for x in moved])) - torque_nm

    at = -float(np.mean(moved))
    for _ in range(NEWTON):
        here = pull(at)
        slope = (pull(at + BESIDE_RAD) - here) / BESIDE_RAD
        if not slope > 0.0:
            return np.nan
        at -= here / slope
    return at if abs(pull(at)) <= 1e-6 * (abs(torque_nm) + equations.jck[2] * float(np.ptp(moved))) else np.nan
