"""The final fit of one model where a torque that nobody recorded limits the runs: prediction error on all samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimate.covariance import orthogonal_part, score_scatter
from identify.estimate.final_fit import FinalFit, free_run_of
from identify.estimate.own_delays import beside_own_delay, freed, have_own_delays, position
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameter_fit import ZERO_INFORMATION
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.reduced import thinned
from identify.signals.trace import Trace
from rig.arrays import Array

MAX_SAMPLES = 60_000  # of the final fit: longer recordings are filtered and decimated, all of them
FINAL_FIT_ITERATIONS = 25  # steps of that fit


def by_prediction_error(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], use: Sequence[Any],
    everything: Sequence[Any], like: Fit | None = None,
) -> FinalFit:  # fmt: skip
    """A model fitted with its disturbance, with the covariance that this likelihood gives.

    Parameters
    ----------
    use, everything
        Samples that fit, and all that are looked at, one boolean array a run.
    like
        A fit to the same recording whose noise to begin from.
    """
    problem, fit = fitted_on_all(traces, structure, start, use, like)
    return as_final(problem, fit, traces, everything)


def fitted_on_all(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], use: Sequence[Any],
    like: Fit | None = None,
) -> tuple[PredictionError, Fit]:  # fmt: skip
    """The likelihood on all samples that fit, and the model fitted by it."""
    few, masks = thinned(traces, use, MAX_SAMPLES)
    problem = PredictionError(few, masks)
    return problem, problem.fit(structure, start, problem.noise_of(like) if like else None, FINAL_FIT_ITERATIONS)


def as_final(problem: PredictionError, fit: Fit, traces: Sequence[Trace], everything: Sequence[Any]) -> FinalFit:
    """The same as a final fit: the runs simulated freely, and what the likelihood knows of each number."""
    structure = fit.structure
    held = free_run_of(traces, structure, fit.values, everything)
    reported = [i for i, n in enumerate(fit.names) if n != ("inertia",) or not problem.torque_free]
    determined = tuple(bool(x > ZERO_INFORMATION) for x in np.diag(fit.information)[reported])
    names, covariance = tuple(fit.names[i] for i in reported), _covariance(problem, fit)[np.ix_(reported, reported)]
    return FinalFit(fit, fit.values, names, covariance, held, False, determined, "prediction error")


def _covariance(problem: PredictionError, fit: Fit) -> Array:
    """Of all parameters, (p, p), where clocks differ beside a delay of each run's own.

    As wide as what is pulled by parts of the runs scatters, if that is more than the likelihood says.
    """
    if not np.isfinite(fit.cost):  # a model that runs away knows nothing of any number
        return fit.covariance
    whole = [orthogonal_part(c.own, np.column_stack([c.columns, c.scaled])) for c in problem.columns_at(fit)]
    parts = [(x[:, :-1], x[:, -1] / np.sqrt(fit.variance)) for x in whole]
    covariance = fit.covariance
    if have_own_delays(problem.traces, fit.names):
        along = [position(s.trace, s.weight, problem.readings) for s in fit.shots]
        parts = [(beside_own_delay(x, fit.names, u), r) for (x, r), u in zip(parts, along, strict=True)]
        information = np.sum([x.T @ x for x, _ in parts], axis=0)
        covariance = freed(replace(fit, information=information).covariance, covariance, fit.names)
    wider = score_scatter(parts)
    return covariance * np.outer(wider, wider)
