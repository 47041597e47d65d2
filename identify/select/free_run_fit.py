"""A structure as fitted over whole runs, its squares in units of the noise's variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.estimate.cross_validation import Judged
from identify.estimate.evaluation import evaluate
from identify.estimate.output_error import Estimate
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split
from identify.signals.trace import Trace
from rig.recording.run import Array

CHANCE = 20.0  # fall of chi square, beyond the penalty, that no chance among all candidates and shapes makes
CHANCES = 5.0  # standard deviations of a mean square
TWICE = 2.0  # times the squares of the best: a special case of it does as well while much is missing
NEAR_THEN = 4.0  # times the best squares of its round: asked again in the finished model
AT_FLOOR = 1.1  # mean square over the noise's variance: who is there has found what there is
ENDS_NEAR = 2.0  # mean square over the noise's variance at the end for what was found to be believed


@dataclass(frozen=True)
class Whole:
    """One structure fitted over whole runs; squares in units of the noise's variance."""

    estimate: Estimate
    squares: float  # on the samples fitted
    count: int
    held: float  # on the held-out samples
    held_count: int
    losses: Array  # held-out squares of every run, (runs,), in units of the channel squared
    counts: Array
    unsettled: float = np.inf  # squares of the fit whose inertia was moved to the bottom of its valley, if it was

    @property
    def structure(self) -> Structure:
        """Its terms and effects."""
        return self.estimate.structure

    @property
    def level(self) -> float:
        """Mean square over the noise's variance, one at least."""
        return max(1.0, self.squares / max(self.count, 1))

    @property
    def at_noise(self) -> bool:
        """Whether nothing is left but what chance makes of the noise."""
        return self.level < 1.0 + CHANCES * float(np.sqrt(2.0 / max(self.count, 1)))

    @property
    def penalised(self) -> float:
        """Chi square and the penalty for parameters (Schwarz 1978)."""
        return self.squares + len(self.estimate.names) * float(np.log(max(self.count, 2)))

    def behind(self, other: Whole) -> float:
        """By how much it is less likely than another, at most as settled; less, if it was less before both were.

        The bottom of a dented valley is no minimum: chance alone lifts one of two by more than what parts them.
        """
        before = min(self.squares, self.unsettled) - min(other.squares, other.unsettled)
        return self.penalised - other.penalised + min(before - (self.squares - other.squares), 0.0)

    def judged(self) -> Judged:
        """As the rest of the search sees a model."""
        return Judged(self.structure, self.estimate, self.losses, self.counts)

    def values(self) -> dict[Name, float]:
        """Parameter values by name."""
        return dict(zip(self.estimate.names, self.estimate.values.tolist(), strict=True))


def measured(traces: Sequence[Trace], split: Split, estimate: Estimate, noise: float, finer: int) -> Whole | None:
    """An estimate on the samples that fit and on those that judge; None where it runs away.

    Parameters
    ----------
    noise
        One standard deviation of the measured channel.
    finer
        How many times the fine steps that models are compared with.
    """
    if not np.isfinite(estimate.sigma):
        return None
    fit = [i for i, m in enumerate(split.fit) if np.any(m)]
    squares, count, losses, counts = 0.0, 0, [], []
    for i, r in zip(fit, estimate.residuals(), strict=True):
        fitted, judged = split.fit[i], split.judge[i]
        squares += float(r[fitted] @ r[fitted])
        count += int(np.sum(fitted))
        if np.any(judged):
            losses.append(float(r[judged] @ r[judged]))
            counts.append(float(np.sum(judged)))
    apart = [i for i, m in enumerate(split.judge) if np.any(m) and i not in fit]
    if apart:
        held = evaluate(estimate, [traces[i] for i in apart], [split.judge[i] for i in apart], None, True, finer)
        for i, r in zip(apart, held.residuals(), strict=True):
            m = split.judge[i]
            losses.append(float(r[m] @ r[m]))
            counts.append(float(np.sum(m)))
    if not (np.isfinite(squares) and np.all(np.isfinite(losses))):
        return None
    variance = noise**2
    return Whole(
        estimate, squares / variance, count, float(np.sum(losses)) / variance, int(np.sum(counts)),
        np.array(losses), np.array(counts),
    )  # fmt: skip
