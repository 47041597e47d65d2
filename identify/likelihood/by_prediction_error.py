"""The final fit of one model where a torque that nobody recorded limits the runs: prediction error on all samples.

How torque and readings lie to each other within a sample is then a guess: a current is read before or after it is set,
passes a filter on the way, and runs between two samples as its loop lets it. Part of a percent of a sample moves the
damping by several of its standard errors. So a small shift of the torque is left open beside the parameters.
"""

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
from identify.model.parameter_fit import MIN_EIGENVALUE_RATIO, ZERO_INFORMATION, sizes
from identify.model.parameters import Name, bounds_of, names_of
from identify.model.structure import Structure
from identify.runs.reduced import thinned
from identify.signals.trace import Trace
from rig import effects
from rig.arrays import Array

MAX_FINAL_FIT_SAMPLES = 60_000  # of the final fit: longer recordings are filtered and decimated, all of them
FINAL_FIT_ITERATIONS = 25  # steps of that fit
NUMBERS_OF_A_DISTURBANCE = 4  # white density, variances of the rough and of the smooth torque, their time constant
SHIFT_STEP = 0.01  # of a sample: for the slope over a shift of the torque
UNIFORM_VARIANCE = 12.0  # one over the variance of what lies anywhere within a unit


def by_prediction_error(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], use: Sequence[Any],
    everything: Sequence[Any], like: Fit | None = None, coarse: bool = True,
) -> FinalFit:  # fmt: skip
    """A model fitted with its disturbance, with the covariance that this likelihood gives.

    Parameters
    ----------
    use, everything
        Samples that fit, and all that are looked at, one boolean array a run.
    like
        A fit to the same recording whose noise to begin from.
    coarse
        With the steps of a search: runs that run free at the sensor's noise are told to a millionth, which those miss.
    """
    problem, fit = fitted_on_all(traces, structure, start, use, like, coarse)
    return as_final(problem, fit, traces, everything)


def disturbance_support(
    traces: Sequence[Trace], use: Sequence[Any], searched: Fit, undisturbed: Mapping[Name, float]
) -> float:  # fmt: skip
    """By how much a torque disturbance is likelier than none, its numbers paid for (twice a log-likelihood).

    A resonance rings with a torque far too small to be seen in the error of a free run, and that error is alike from
    period to period: it takes far more samples to average out than white noise of its size does.

    Parameters
    ----------
    searched
        A model as the search has fitted it, with a disturbance.
    undisturbed
        Values of the same model fitted by its free run, without.
    """
    few, masks = thinned(traces, use, MAX_FINAL_FIT_SAMPLES)
    problem = PredictionError(few, masks, coarse=False)
    noise = problem.noise_of(searched)
    none = replace(noise, white=0.0, slow=0.0, smooth=0.0)
    without = problem.fit(searched.structure, undisturbed, none, 0, thorough=False)
    beside = problem.fit(searched.structure, searched.values, noise, 0, thorough=False)
    paid = NUMBERS_OF_A_DISTURBANCE * float(np.log(max(beside.count, 2)))
    return without.cost - beside.cost - paid


def fitted_on_all(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], use: Sequence[Any],
    like: Fit | None = None, coarse: bool = True,
) -> tuple[PredictionError, Fit]:  # fmt: skip
    """The likelihood on all samples that fit, and the model fitted by it."""
    few, masks = thinned(traces, use, MAX_FINAL_FIT_SAMPLES)
    problem = PredictionError(few, masks, coarse)
    return problem, problem.fit(structure, start, problem.noise_of(like) if like else None, FINAL_FIT_ITERATIONS)


def as_final(problem: PredictionError, fit: Fit, traces: Sequence[Trace], everything: Sequence[Any]) -> FinalFit:
    """The same as a final fit: the runs simulated freely, and what the likelihood knows of each number."""
    structure = fit.structure
    moved, spread = _beside_shift(problem, fit)
    low, high = np.array([bounds_of(n, fit.names) for n in fit.names]).T
    values = dict(zip(fit.names, np.clip(fit.vector + moved, low, high).tolist(), strict=True))
    held = free_run_of(traces, structure, values, everything)
    reported = [i for i, n in enumerate(fit.names) if n != ("inertia",) or not problem.torque_free]
    determined = tuple(bool(x > ZERO_INFORMATION) for x in np.diag(fit.information)[reported])
    names, covariance = tuple(fit.names[i] for i in reported), _covariance(problem, fit) + spread
    covariance = covariance[np.ix_(reported, reported)]
    return FinalFit(fit, values, names, covariance, held, False, determined, "prediction error")


def _beside_shift(problem: PredictionError, fit: Fit) -> tuple[Array, Array]:
    """What a shift of the torque within a sample moves the parameters by, (p,), and how that spreads them, (p, p).

    Nothing where the recording says when the torque acted (values held from sample to sample), or where the model has a
    delay or a lag of its own. A shift is no larger than half a sample, all alike likely, as far as anybody knows.
    """
    nothing = np.zeros(len(fit.names)), np.zeros((len(fit.names), len(fit.names)))
    own = [effects.get(e) for e in fit.structure.effects]
    open_already = any(e.lag is not None or e.delay_s is not None for e in own)
    torques = [t.torque for t in problem.traces if t.torque is not None and t.torque.hold != "zero_order"]
    if len(torques) < len(problem.traces) or open_already or not np.isfinite(fit.cost):
        return nothing
    sample_s = float(np.median(np.concatenate([np.diff(t.time_s) for t in torques])))
    whole = [
        orthogonal_part(c.own, np.column_stack([c.columns, late, c.scaled]))
        for c, late in zip(problem.columns_at(fit), _shifted(problem, fit), strict=True)
    ]
    matrix = np.sum([x[:, :-1].T @ x[:, :-1] for x in whole], axis=0)
    pulled = float(np.sum([x[:, -2] @ x[:, -1] for x in whole]))  # the parameters are pulled by nothing: it is a fit
    if not (np.all(np.isfinite(matrix)) and matrix[-1, -1] > 0.0):
        return nothing
    size = sizes(np.diag(matrix))[:-1]
    scaled = matrix[:-1, :-1] / np.outer(size, size)
    # What the parameters become for a unit of the shift.
    by_shift = -np.linalg.pinv(scaled, rcond=MIN_EIGENVALUE_RATIO, hermitian=True) @ (matrix[:-1, -1] / size) / size
    known = max(float(matrix[-1, -1] + matrix[-1, :-1] @ by_shift), 0.0) / fit.variance
    precision = known + UNIFORM_VARIANCE / sample_s**2
    shift_s = float(np.clip(pulled / fit.variance / precision, -0.5 * sample_s, 0.5 * sample_s))
    return by_shift * shift_s, np.outer(by_shift, by_shift) / precision


def _shifted(problem: PredictionError, fit: Fit) -> list[Array]:
    """What a later torque does to every run's scaled innovations, (n,) each, as ``Columns.columns`` has it."""
    structure, step_s = fit.structure.plus("torque_delay"), SHIFT_STEP * problem.step_s
    names = names_of(structure, problem.runs)
    x = np.array([fit.values.get(n, step_s) for n in names])
    out = []
    for s in fit.shots:
        here = problem.look(s, fit.structure, fit.names, fit.vector, fit.noise)
        later = problem.look(s, structure, names, x, fit.noise, here.gains)
        change = (here.innovations - later.innovations)[s.weight] / (step_s * np.sqrt(here.variance[s.weight]))
        out.append(change.ravel())
    return out


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
