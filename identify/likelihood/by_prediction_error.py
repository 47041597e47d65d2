"""The final fit of one model where a torque that nobody recorded limits the runs: prediction error on all samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.estimate.final_fit import Fitted, free_run_of
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.reduced import thinned
from identify.signals.trace import Trace

MOST_SAMPLES = 60_000  # of the final fit: longer recordings are filtered and decimated, all of them
STEPS = 25
DEAD = 1e-280  # of information: what a parameter without any influence leaves of rounding


def by_prediction_error(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], use: Sequence[Any],
    everything: Sequence[Any], free_run: bool = True, like: Fit | None = None,
) -> tuple[Fitted, Fit]:  # fmt: skip
    """A model fitted with its disturbance, with the covariance that this likelihood gives.

    Parameters
    ----------
    use, everything
        Samples that fit, and all that are looked at, one boolean array a run.
    free_run
        Whether the model is simulated over the whole of each run besides.
    like
        A fit to the same recording whose noise to begin from.
    """
    few, masks = thinned(traces, use, MOST_SAMPLES)
    problem = PredictionError(few, masks)
    fit = problem.fit(structure, start, problem.noise_of(like) if like else None, STEPS)
    values = dict(fit.values)
    held = free_run_of(traces, structure, values, everything) if free_run else None
    told = [i for i, n in enumerate(fit.names) if n != ("inertia",) or not problem.torque_free]
    determined = tuple(bool(x > DEAD) for x in np.diag(fit.information)[told])
    fitted = Fitted(
        structure, values, fit.covariance[np.ix_(told, told)], tuple(fit.names[i] for i in told),
        float(np.sqrt(fit.variance)), held, False, determined, "prediction error",
    )  # fmt: skip
    return fitted, fit
