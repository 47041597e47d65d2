"""Torque and rate that disagree by a little more or less in every run, made to agree.

Where a drive and a gyro have clocks of their own, every run has a delay of its own that changes evenly along it
(``identify.estimate.own_delays``). What differs looks like damping, or like a memory of the platform. So beside the
model that was found every run gets the delay that it shows, and its torque is moved by how much that differs from what
all have in the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from identify.estimate.covariance import orthogonal_part
from identify.estimate.own_delays import DELAY_NAME, have_own_delays, of_own_clock, position
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.runs.reduced import thinned
from identify.signals.trace import Trace
from identify.wording import number
from rig.arrays import Array
from rig.dynamics.torque import TorqueSignal

if TYPE_CHECKING:
    from identify.select.stepwise import Stepwise

MAX_DELAY_SAMPLES = 120_000  # that are looked at
ROUNDS, FIT_STEPS = 4, 3  # of moving them, and of the model in each
SURE_RATIO = 10.0  # times what clocks bring: no name that brings more is theirs
MAX_SHIFT_S = 50e-6  # of a run: two clocks that disagree by more show something else
RCOND = 1e-12  # of the largest singular value, below which one is zero: what double precision leaves


class Aligned(NamedTuple):
    """Runs whose torque was moved.

    Attributes
    ----------
    brought
        By how much that lowers minus twice the log-likelihood, a sample.
    """

    traces: list[Trace]
    brought: float

    def may_explain(self, search: Stepwise) -> bool:
        """Whether clocks that disagreed may have been taken for an effect: one that brought about as little."""
        costs = [*(r.now.cost for r in search.rounds if r.added), search.best.cost]
        least = min((a - b for a, b in pairwise(costs)), default=np.inf)
        return least < SURE_RATIO * self.brought * search.best.count


def aligned(traces: Sequence[Trace], use: Sequence[Any], best: Fit) -> Aligned | None:
    """The runs with their torque moved to the delay that all have in the mean; None where none shows another.

    Parameters
    ----------
    use
        Samples that fit, one boolean array a run.
    best
        The model that was found, fitted to some of the samples.
    """
    if not have_own_delays(traces, best.names):
        return None
    moved: Aligned | None = None
    for _ in range(ROUNDS):
        runs = moved.traces if moved else traces
        few, masks = thinned(runs, use, MAX_DELAY_SAMPLES)
        problem = PredictionError(few, masks)
        best = problem.fit(best.structure, best.values, problem.noise_of(best), FIT_STEPS, thorough=False)
        if not np.isfinite(best.cost):
            break
        own_s, brought = _own_delays(problem, best)
        likelier = brought > (own_s.size - 1) * np.log(max(best.count, 2))
        if not likelier or np.max(np.sum(np.abs(own_s), axis=1)) > MAX_SHIFT_S:
            break
        later = [_later(t, *line_s) for t, line_s in zip(runs, own_s.tolist(), strict=True)]
        moved = Aligned(later, brought / best.count + (moved.brought if moved else 0.0))
    return moved


def told(given: Sequence[Trace], moved: Sequence[Trace]) -> str:
    """A note that runs were moved, and by how much at most."""
    both = [(a.torque, b.torque) for a, b in zip(given, moved, strict=True)]
    late_s = [float(np.max(np.abs(b.time_s - a.time_s))) for a, b in both if a is not None and b is not None]
    return (
        f"The delay between torque and rate differs from run to run, by up to {number(1e6 * max(late_s), 2)} us (two "
        "clocks): every run is fitted with its own, and the intervals include that."
    )


def _own_delays(problem: PredictionError, fit: Fit) -> tuple[Array, float]:
    """By how much every run's delay is longer than all have in the mean, (runs, 2), and what that brings.

    A run's delay is a line: in the middle of the run, and half its change along it. What it brings is by how much minus
    twice the log-likelihood falls, all other parameters free.
    """
    parts, at, shared = problem.columns_at(fit), fit.names.index(DELAY_NAME), len(fit.names) - 1
    size = shared + 2 * len(parts)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    rest = [k for k in range(shared + 1) if k != at]
    for r, (part, shots) in enumerate(zip(parts, fit.shots, strict=True)):
        clock = of_own_clock(part.columns, fit.names, position(shots.trace, shots.weight, problem.readings))
        wide = np.column_stack([part.columns[:, rest], clock, part.scaled])
        seen = orthogonal_part(part.own, wide) / np.sqrt(fit.variance)
        here = [*range(shared), shared + 2 * r, shared + 2 * r + 1]
        matrix[np.ix_(here, here)] += seen[:, :-1].T @ seen[:, :-1]
        right[here] += seen[:, :-1].T @ seen[:, -1]
    one = np.zeros((size, shared + 1))  # one delay for all, all along
    one[:shared, :shared] = np.eye(shared)
    one[shared::2, -1] = 1.0
    apart, together = _solved(matrix, right), one @ _solved(one.T @ matrix @ one, one.T @ right)
    own_s, known = apart[shared:].reshape(-1, 2), np.diag(matrix)[shared::2]
    own_s[:, 0] -= float(known @ own_s[:, 0]) / max(float(np.sum(known)), 1e-300)
    return own_s, float(right @ (apart - together))


def _solved(matrix: Array, right: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(size, size), rcond=RCOND, hermitian=True)
    return np.asarray(inverse @ (right / size) / size)


def _later(trace: Trace, late_s: float, changing_s: float) -> Trace:
    """The run with its torque so much later in its middle, and by ``changing_s`` more at its end than there."""
    given = trace.torque
    assert given is not None
    half_s = 0.5 * trace.step_s * max(len(trace.measured) - 1, 1)
    along = np.clip((given.time_s - trace.start_s) / half_s - 1.0, -1.0, 1.0)
    later = given.time_s + late_s + changing_s * along
    return replace(trace, torque=TorqueSignal(later, given.torque_nm, given.hold), _series={})
