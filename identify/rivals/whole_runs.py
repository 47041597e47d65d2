"""Structures fitted by output error over whole runs: what they leave where they were fitted, and where held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.evaluation import evaluate
from identify.estimate.output_error import OutputErrorFit, refine
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split
from identify.signals.trace import Trace, pooled_noise

TOLERANCE = 3e-4  # of a fit: ``refine`` says of what
WHOLE_RUN_STEPS = 15  # steps of a fit


class FreeRunFitter:
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
        self.noise = pooled_noise(traces)
        self.torque_free = all(t.torque is None for t in traces)
        self.fixed: list[Name] = [("inertia",)] if self.torque_free else []

    def fitted(
        self, structure: Structure, start: Mapping[Name, float], steps: int = WHOLE_RUN_STEPS,
        horizon_s: float | None = None,
    ) -> OutputErrorFit | None:  # fmt: skip
        """A structure fitted from a start; None where it runs away.

        ``horizon_s``: by way of a fit over short spans, whose error has fewer false minima.
        """
        if horizon_s is not None:
            near = refine(
                self.fitting, structure, start, horizon_s, 8, self.use, fixed=self.fixed, coarse=True, tolerance=1e-3
            )
            if np.isfinite(near.sigma):
                start = near.values
        fit = refine(
            self.fitting, structure, start, None, steps, self.use, fixed=self.fixed, coarse=True, tolerance=TOLERANCE
        )
        return self._measured(fit)

    def _measured(self, fit: OutputErrorFit) -> OutputErrorFit | None:
        """A fit on the samples that fit and on those that judge; None where it runs away."""
        if not np.isfinite(fit.sigma):
            return None
        squares, count, losses, counts = 0.0, 0, [], []
        for i, r in zip(self.on, fit.residuals(), strict=True):
            fitted, judged = self.split.fit[i], self.split.judge[i]
            squares += float(r[fitted] @ r[fitted])
            count += int(np.sum(fitted))
            if np.any(judged):
                losses.append(float(r[judged] @ r[judged]))
                counts.append(float(np.sum(judged)))
        apart = [i for i, m in enumerate(self.split.judge) if np.any(m) and i not in self.on]
        if apart:
            masks = [self.split.judge[i] for i in apart]
            held = evaluate(fit, [self.traces[i] for i in apart], masks, None, True)
            for m, r in zip(masks, held.residuals(), strict=True):
                losses.append(float(r[m] @ r[m]))
                counts.append(float(np.sum(m)))
        if not (np.isfinite(squares) and np.all(np.isfinite(losses))):
            return None
        held_out = replace(fit, held_out_squares=np.array(losses), held_out_counts=np.array(counts))
        return held_out.with_residual(squares, count, self.noise)
