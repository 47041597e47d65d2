"""A structure fitted by output error over whole runs: its squares where it was fitted, and where it was held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.estimate.evaluation import evaluate
from identify.estimate.judged import Judged
from identify.estimate.output_error import Estimate, refine
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split
from identify.signals.trace import Trace
from rig.arrays import Array

TOLERANCE = 3e-4
STEPS = 15


@dataclass(frozen=True)
class WholeFit:
    """One structure fitted over whole runs; squares in units of the noise's variance."""

    estimate: Estimate
    squares: float  # on the samples fitted
    count: int
    losses: Array  # held-out squares of every run, (runs,), in units of the channel squared
    counts: Array
    noise: float

    @property
    def structure(self) -> Structure:
        """Its terms and effects."""
        return self.estimate.structure

    @property
    def level(self) -> float:
        """Mean square over the noise's variance, one at least."""
        return max(1.0, self.squares / max(self.count, 1))

    @property
    def held(self) -> float:
        """Squares on the held-out samples."""
        return float(np.sum(self.losses)) / self.noise**2

    @property
    def penalised(self) -> float:
        """Chi square and the penalty for parameters (Schwarz 1978)."""
        return self.squares + len(self.estimate.names) * float(np.log(max(self.count, 2)))

    def judged(self) -> Judged:
        """As the report sees a model."""
        return Judged(self.structure, self.estimate, self.losses, self.counts)

    def values(self) -> dict[Name, float]:
        """Parameter values by name."""
        return dict(zip(self.estimate.names, self.estimate.values.tolist(), strict=True))


class WholeRuns:
    """Fits to the samples of one recording that fit, compared on equal terms.

    Parameters
    ----------
    traces, split
        The runs, and which of their samples fit and judge.
    """

    def __init__(self, traces: Sequence[Trace], split: Split) -> None:
        self.traces, self.split = traces, split
        self.on = [i for i, m in enumerate(split.fit) if np.any(m)]
        self.fitting, self.use = [traces[i] for i in self.on], [split.fit[i] for i in self.on]
        self.noise = float(np.sqrt(np.mean([t.noise**2 for t in traces])))
        self.torque_free = all(t.torque is None for t in traces)
        self.fixed: list[Name] = [("inertia",)] if self.torque_free else []

    def fitted(
        self, structure: Structure, start: Mapping[Name, float], steps: int = STEPS, horizon_s: float | None = None
    ) -> WholeFit | None:
        """A structure fitted from a start; None where it runs away.

        ``horizon_s``: by way of a fit over short spans, whose error has fewer false minima.
        """
        if horizon_s is not None:
            near = refine(
                self.fitting, structure, start, horizon_s, 8, self.use, fixed=self.fixed, coarse=True, tolerance=1e-3
            )
            if np.isfinite(near.sigma):
                start = dict(zip(near.names, near.values.tolist(), strict=True))
        estimate = refine(
            self.fitting, structure, start, None, steps, self.use, fixed=self.fixed, coarse=True, tolerance=TOLERANCE
        )
        return self._measured(estimate)

    def _measured(self, estimate: Estimate) -> WholeFit | None:
        """An estimate on the samples that fit and on those that judge; None where it runs away."""
        if not np.isfinite(estimate.sigma):
            return None
        squares, count, losses, counts = 0.0, 0, [], []
        for i, r in zip(self.on, estimate.residuals(), strict=True):
            fitted, judged = self.split.fit[i], self.split.judge[i]
            squares += float(r[fitted] @ r[fitted])
            count += int(np.sum(fitted))
            if np.any(judged):
                losses.append(float(r[judged] @ r[judged]))
                counts.append(float(np.sum(judged)))
        apart = [i for i, m in enumerate(self.split.judge) if np.any(m) and i not in self.on]
        if apart:
            masks = [self.split.judge[i] for i in apart]
            held = evaluate(estimate, [self.traces[i] for i in apart], masks, None, True)
            for m, r in zip(masks, held.residuals(), strict=True):
                losses.append(float(r[m] @ r[m]))
                counts.append(float(np.sum(m)))
        if not (np.isfinite(squares) and np.all(np.isfinite(losses))):
            return None
        return WholeFit(estimate, squares / self.noise**2, count, np.array(losses), np.array(counts), self.noise)
