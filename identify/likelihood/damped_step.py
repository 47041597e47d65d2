"""One damped step of a descent: how short it has to be for the cost to fall, and whether the noise goes with it.

The parameters and the noise are damped apart (Levenberg; Marquardt 1963). The cost is nearly square in the parameters,
but far from it in the logarithms of the noise, which may begin decades off. Where the parameters alone would go down,
only the noise is held shorter; along a valley of the parameters the steps then stay long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identify.likelihood.normal_equations import COST_TOLERANCE, Step, bounded_step, changed, logs_of
from identify.model.parameters import ordered
from rig.arrays import Array

if TYPE_CHECKING:
    from identify.likelihood.descent import Descent

MAX_STEP_TRIALS = 7  # step lengths tried before a direction is given up
LEVENBERG_DAMPING, LEAST_DAMPING = 1e-4, 1e-9  # of a first step, and after many that went down


@dataclass(frozen=True)
class _Reach:
    """What a step is made of: the normal equations, scaled to a diagonal of ones, and how far it may go, (n,) each."""

    step: Step
    matrix: Array  # (n, n)
    right: Array
    size: Array
    low: Array
    high: Array
    ratios: Sequence[bool]  # whether each number of the noise is a ratio to the variance of a reading


def begin_damping(d: Descent) -> None:
    """Damp the next step of a descent as a first one."""
    d.damping = d.noise_damping = LEVENBERG_DAMPING


def step_down(d: Descent, found: Step, of_noise: bool, enough: float) -> bool:
    """Move a descent down by one step; False where no step promises ``enough``, or none goes down."""
    ratios = [not kind.endswith("_s") for kind in d.kinds] if of_noise else []
    if not np.all(np.isfinite(np.column_stack([found.matrix, found.right]))):
        return False
    size: Array = np.sqrt(np.maximum(np.diag(found.matrix), 1e-300))
    scaled, right = found.matrix / np.outer(size, size), found.right / size
    low, high = (bound * size for bound in d.room(len(size) - len(d.x)))
    seen = np.diag(found.matrix) > 0.0
    low, high = np.where(seen, low, 0.0), np.where(seen, high, 0.0)
    best = bounded_step(scaled, right, low, high)
    if found.promised + float((2.0 * right - scaled @ best) @ best) < max(0.2 * COST_TOLERANCE, enough):
        return False  # what a step promises is not worth taking
    reach = _Reach(found, scaled, right, size, low, high, ratios)
    blamed: float | None = None  # the damping at which the parameters alone went down
    for _ in range(MAX_STEP_TRIALS):
        if _goes_down(d, reach, with_noise=True):
            d.damping, d.noise_damping = (max(x / 10.0, LEAST_DAMPING) for x in (d.damping, d.noise_damping))
            return True
        if ratios and blamed != d.damping and _goes_down(d, reach, with_noise=False):
            blamed = d.damping
        if blamed != d.damping:
            d.damping = max(10.0 * d.damping, 1e-3)
        d.noise_damping = max(100.0 * d.noise_damping, 1e-2)
    return False


def _goes_down(d: Descent, reach: _Reach, with_noise: bool) -> bool:
    """Whether a step as damped as it is now goes down; one with the noise is then taken."""
    of_parameters = np.arange(len(reach.size)) < len(d.x)
    damping = np.where(of_parameters, d.damping, d.noise_damping)
    room = 1.0 if with_noise else of_parameters
    step = bounded_step(reach.matrix + np.diag(damping), reach.right, room * reach.low, room * reach.high) / reach.size
    x = ordered(d.names, np.clip(d.x + step[: len(d.x)], d.low, d.high))
    change = np.concatenate([x - d.x, logs_of(step[len(d.x) :], reach.step.level, reach.ratios)])
    noise = d.with_logs(change[len(d.x) :])
    own = zip(d.shots, reach.step.own, strict=True)
    # What a run has of its own follows the parameters all the way, however short their step is; else no step along a
    # valley of both goes down (a gyro's bias that has turned a wave over the angle).
    shots = [changed(s, taken / (1.0 + d.damping) - across @ change) for s, (across, taken) in own]
    looks = d.looks_at(x, noise, shots)
    cost = d.cost_of(looks)
    if not cost < d.cost:
        return False
    if with_noise:
        d.x, d.shots, d.looks, d.cost, d.noise = x, shots, looks, cost, noise
    return True
