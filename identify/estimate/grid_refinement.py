"""The last step of the final fit: what a simulation four times as fine would change, without fitting with it.

Steps that are fine enough for the noise of a sample are not always fine enough for a hundred thousand of them: what a
step leaves out repeats with the excitation, and bends parameters by several of their standard errors. Sensitivities
hold on either grid, so the residual on the finer one and a step or two along them are all that is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimate.output_error import OutputErrorFit, held_still
from identify.model.parameters import Name, bounds_of, ordered
from identify.signals.trace import Trace
from identify.simulate.all_runs import shots_for
from identify.simulate.sensitivities import at_residual, linearise
from identify.simulate.shots import RUNAWAY, Shots, moved, residual_at
from rig.recording.run import Array

GRID_REFINEMENT_FACTOR = 4  # times the simulator's steps
GRID_REFINEMENT_STEPS = 2  # steps of the fit on the finer grid
NOTHING = 0.05  # standard errors: by less than that nothing is changed


@RUNAWAY
def sharpened(
    fit: OutputErrorFit, traces: Sequence[Trace], use: Sequence[Any], fixed: Sequence[Name]
) -> OutputErrorFit:
    """A fit over whole runs, brought to where a finer simulation would have led it.

    Parameters
    ----------
    traces, use, fixed
        As ``refine`` had them.

    Returns
    -------
    The fit itself where that is nearer than a twentieth of a standard error, or where the finer simulation fits
    no better after the step.
    """
    structure, names = fit.structure, fit.names
    still = held_still(names, traces, use, fixed)
    low, high = (np.array([bounds_of(n, names)[i] for n in names]) for i in (0, 1))
    with ThreadPoolExecutor(2) as workers:

        def residuals(shots: Sequence[Shots], x: Array) -> tuple[list[Array], float]:
            found = list(workers.map(lambda s: residual_at(s, structure, names, x), shots))
            return [r for r, _ in found], float(sum(np.sum(losses) for _, losses in found))

        x = fit.vector
        scale = np.where(np.abs(x) > 0, np.abs(x), 1.0)
        shots = shots_for(traces, structure, names, x, None, use, fit.shots, coarse=False, finer=GRID_REFINEMENT_FACTOR)
        parts = list(workers.map(lambda s: linearise(s, structure, names, fit.vector, scale, still, np.inf), fit.shots))
        left, begun = residuals(shots, x)
        cost = begun
        for number in range(GRID_REFINEMENT_STEPS):
            parts = [at_residual(q, s, r, np.inf) for q, s, r in zip(parts, shots, left, strict=True)]
            a, b = np.sum([q.a for q in parts], axis=0), np.sum([q.b for q in parts], axis=0)
            dx = _solved(a, b, ~still)
            if dx is None:
                break
            new = ordered(names, np.clip(x + dx, low, high))
            size = np.sqrt(np.maximum(np.diag(a), 0.0)) / max(fit.sigma, 1e-300)
            if number == 0 and float(np.max(np.abs(new - x) * size, initial=0.0)) < NOTHING:
                return fit
            trial = [moved(s, q.back(new - x)) for s, q in zip(shots, parts, strict=True)]
            after, lower = residuals(trial, new)
            if not lower < cost:
                break
            x, shots, left, cost = new, trial, after, lower
    if not cost < begun:
        return fit
    return replace(fit, vector=x, shots=tuple(shots)).with_residual(cost, fit.count, fit.noise)


def _solved(a: Array, b: Array, free: Any) -> Array | None:
    size = np.sqrt(np.maximum(np.diag(a), 1e-300))
    scaled, right = (a / np.outer(size, size))[np.ix_(free, free)], (b / size)[free]
    if not (np.all(np.isfinite(scaled)) and np.all(np.isfinite(right))):
        return None
    out = np.zeros(len(b))
    out[free] = np.linalg.lstsq(scaled, right, rcond=1e-12)[0]
    return np.asarray(out / size)
