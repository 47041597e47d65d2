"""The final fit where the sensor alone limits, or by regression; its uncertainties hold for coloured residuals too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from identify.estimate.covariance import rms_of, sandwich
from identify.estimate.evaluation import evaluate
from identify.estimate.grid_refinement import sharpened
from identify.estimate.initial_guess import Start, best_rho
from identify.estimate.initial_state_sensitivity import least_std_errors
from identify.estimate.output_error import OutputErrorFit, refine
from identify.estimate.own_delays import beside_own_delay, freed, have_own_delays, position
from identify.estimate.profile_likelihood import settled, widened
from identify.estimate.regression import Regression, RegressionFit, residuals
from identify.estimate.starting_point import start_values
from identify.model.parameter_fit import ParameterFit, std_error_of
from identify.model.parameters import Name, is_gain
from identify.model.structure import Structure
from identify.results import NORMAL_95
from identify.signals.trace import Trace
from identify.simulate.sensitivities import INFORMATION_RCOND, jacobian
from identify.simulate.shots import Shots
from rig import effects
from rig.recording.run import Array

NEAR_FLOOR = 1.3**2  # reduced chi-square: close enough for a free run over the whole set
FEW_NOISES = 5.0**2  # reduced chi-square of a free run: disturbed moments, not a wrong model
OUTPUT_ERROR_STEPS = 12  # steps of a fit
FREER = 0.95**2  # of the mean square of the free run


@dataclass(frozen=True)
class FinalFit:
    """One model as it is reported, with its uncertainty.

    Attributes
    ----------
    fit
        What the model was fitted by.
    values
        All parameters, those too that were held still (the inertia of a decay) or that the free run found.
    names, covariance
        Parameters that have an uncertainty, and their covariance, for a coloured residual, too, (p, p).
    free_run
        The model simulated over the whole of each run, start states fitted; None where it runs away.
    sensor_limited
        The free run leaves no more than the sensor's noise.
    determined
        Parameters that the data determine (False along directions of the information that are empty).
    between_rivals
        Standard deviation of J, C and K over models that the data do not part from this one.
    """

    fit: ParameterFit
    values: Mapping[Name, float]
    names: tuple[Name, ...]
    covariance: Array
    free_run: OutputErrorFit | None
    sensor_limited: bool
    determined: tuple[bool, ...]
    method: str
    between_rivals: Mapping[Name, float] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """Its terms and effects."""
        return self.fit.structure

    def std_error(self, name: Name) -> float:
        """One standard error of a parameter."""
        return std_error_of(name, self.names, self.covariance)

    def support_of(self, effect: str) -> float:
        """By how much an effect's gains differ from none: their squares over their covariance, parameters paid for.

        A Wald statistic, on the scale of twice a log-likelihood; infinite for an effect that has no gain.
        """
        own = [i for i, n in enumerate(self.names) if n[0] == effect]
        at = [i for i in own if is_gain(self.names[i])]
        covariance = self.covariance[np.ix_(at, at)]
        if not at or not np.all(np.isfinite(covariance)):
            return float("inf")
        gains = np.array([self.values[self.names[i]] for i in at])
        size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        scaled = np.linalg.pinv(covariance / np.outer(size, size), rcond=INFORMATION_RCOND, hermitian=True)
        wald = float((gains / size) @ scaled @ (gains / size))
        return wald - len(own) * float(np.log(max(self.fit.count, 2)))

    def is_significant(self, effect: str) -> bool:
        """Whether the 95 % interval of one of an effect's gains (of its parameters, if it has none) excludes none."""
        own = [n for n in self.names if n[0] == effect]
        neutral = {p.name: p.neutral for p in effects.get(effect).parameters}
        asked = [n for n in own if is_gain(n)] or own
        return any(abs(self.values[n] - neutral[str(n[1])]) > NORMAL_95 * self.std_error(n) for n in asked)

    def as_uncertain_as(self, fuller: FinalFit) -> FinalFit:
        """The same where a term was left out that may be there: as uncertain as the fit that has it, if that is more.

        A platform without damping rings on, and follows the noise closely with any inertia.
        """
        at = [fuller.names.index(n) for n in self.names]
        theirs = fuller.covariance[np.ix_(at, at)]
        both = tuple(a and fuller.determined[i] for a, i in zip(self.determined, at, strict=True))
        size = np.sqrt(np.maximum(np.diag(theirs), 1e-300))
        if not (np.all(np.isfinite(theirs)) and np.all(np.isfinite(self.covariance))):
            return replace(self, covariance=np.where(np.isfinite(theirs), self.covariance, theirs), determined=both)
        values, vectors = np.linalg.eigh((theirs - self.covariance) / np.outer(size, size))
        more = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return replace(self, covariance=self.covariance + more * np.outer(size, size), determined=both)

    def reported_error(self, name: Name) -> float:
        """One standard error of a parameter, with what is uncertain because rivals of the model may be true."""
        return float(np.hypot(self.std_error(name), self.between_rivals.get(name, 0.0)))


def by_regression(
    traces: Sequence[Trace], structure: Structure, shapes: Mapping[str, tuple[float, ...]], start: Start,
    use: Sequence[Any], everything: Sequence[Any], shape_errors: Mapping[Name, float],
) -> FinalFit:  # fmt: skip
    """A model that stays far from the data: white-residual regression at its best filter.

    ``shape_errors`` are the standard errors of shape parameters, which the regression takes as given.
    """
    solution = best_rho(traces, structure, shapes, start, use)
    runs = 1 + max(t.number for t in traces)
    values = start_values(solution, shapes, runs)
    covariance, determined = _regression_covariance(traces, solution, use)
    free = free_run_of(traces, structure, values, everything)
    values = _own_gains_of(free, values)
    limited = free is not None and free.reduced_chi_square < NEAR_FLOOR
    found = [n for n in values if len(n) > 1 and n not in solution.names and n in shape_errors]
    names = (*solution.names, *found)
    covariance = block_diag(covariance, np.diag([shape_errors[n] ** 2 for n in found])) if found else covariance
    determined = (*determined, *(bool(np.isfinite(shape_errors[n])) for n in found))
    return FinalFit(solution, values, names, covariance, free, limited, determined, "regression")


def free_run_of(
    traces: Sequence[Trace], structure: Structure, values: Mapping[Name, float], use: Sequence[Any]
) -> OutputErrorFit | None:
    """The model simulated over the whole of each run, start states fitted; None where it runs away."""
    held = OutputErrorFit.unfitted(structure, tuple(values), np.array(list(values.values())))
    free = evaluate(held, traces, use)
    return free if np.isfinite(free.sigma) else None


def _own_gains_of(free: OutputErrorFit | None, values: Mapping[Name, float]) -> dict[Name, float]:
    """Values with the gains that runs have of their own as the free run found them: no fit knew those held out."""
    if free is None:
        return dict(values)
    return {**values, **{n: v for n, v in free.values.items() if len(n) == 3}}


def by_output_error(
    traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float], horizon: float,
    use: Sequence[Any], everything: Sequence[Any],
) -> FinalFit:  # fmt: skip
    """Output error from a short horizon to the whole run, as far as the model can be trusted."""
    torque_free = all(t.torque is None for t in traces)
    fixed = [("inertia",)] if torque_free else []

    def refit(
        values: Mapping[Name, float], *, rests: bool = False, held: Sequence[Name] = (),
        carry: Sequence[Shots] | None = None,
    ) -> OutputErrorFit:  # fmt: skip
        return refine(traces, structure, values, None, OUTPUT_ERROR_STEPS, use, carry, [*fixed, *held], rests=rests)

    at_once, valley = settled(refit(start), refit)
    best = at_once
    straight = best.reduced_chi_square <= NEAR_FLOOR  # the search came close enough: no ladder of horizons needed
    if not straight:
        best = refine(traces, structure, start, horizon, OUTPUT_ERROR_STEPS, use, fixed=fixed)
    whole_runs = [at_once]
    for longer in () if straight else (4.0 * horizon, None):
        trial = refine(traces, structure, best.values, longer, OUTPUT_ERROR_STEPS, use, fixed=fixed)
        whole_runs += [trial] if longer is None else []
        if trial.reduced_chi_square <= NEAR_FLOOR:
            best = trial
    # Only the model itself leads a decay astray, and near the noise a few disturbed moments do: whole runs decide.
    if not straight and (torque_free or at_once.reduced_chi_square < FEW_NOISES):
        held = free_run_of(traces, structure, best.values, use)
        if held is None or at_once.variance < FREER * held.variance:
            best = at_once
    whole = best if any(best is w for w in whole_runs) else None
    free_names = tuple(n for n in best.names if n not in fixed)
    covariance, determined = _output_covariance(best, free_names)
    if valley is not None and best is at_once:
        covariance = widened(covariance, free_names, best, valley)
    if whole is not None and whole.reduced_chi_square <= NEAR_FLOOR:
        best = whole = sharpened(whole, traces, use, fixed)
    same = all(np.array_equal(u, e) for u, e in zip(use, everything, strict=True))
    free = whole if whole is not None and same else free_run_of(traces, structure, best.values, everything)
    values = _own_gains_of(free, best.values)
    limited = whole is not None and whole.reduced_chi_square <= NEAR_FLOOR
    method = "output error over whole runs" if whole is not None else f"output error over {horizon:.3g} s"
    return FinalFit(best, values, free_names, covariance, free, limited, determined, method)


def _output_covariance(fit: OutputErrorFit, names: tuple[Name, ...]) -> tuple[Array, tuple[bool, ...]]:
    keep = [fit.names.index(n) for n in names]
    parts, along = [], []
    for shots in fit.shots:
        if not np.any(shots.weight):
            continue
        columns, residual = jacobian(shots, fit.structure, fit.names, fit.vector)
        parts.append((columns[:, keep], residual))
        along.append(position(shots.trace, shots.weight))
    sigma = rms_of(parts, len(names) + 2 * sum(len(s.first) for s in fit.shots))
    covariance, determined = sandwich(parts, sigma)
    if have_own_delays([s.trace for s in fit.shots], names):
        apart, _ = sandwich([(beside_own_delay(x, names, u), r) for (x, r), u in zip(parts, along, strict=True)], sigma)
        covariance = freed(apart, covariance, names)
    if len(fit.shots) > 1:
        return covariance, determined
    # A single run has nothing beside it that tells what its ring may only seem to tell.
    least = least_std_errors(fit.shots[0], fit, names, sigma)
    wider = np.maximum(1.0, least / np.sqrt(np.maximum(np.diag(covariance), 1e-300)))
    return covariance * np.outer(wider, wider), determined


def _regression_covariance(
    traces: Sequence[Trace], solution: RegressionFit, use: Sequence[Any]
) -> tuple[Array, tuple[bool, ...]]:
    regression = Regression(traces, solution.structure)
    blocks = regression.blocks(solution.denominator, solution.shapes)
    p = len(solution.names)
    parts = []
    for block, whole in zip(blocks, residuals(blocks, solution.vector), strict=True):
        mask = use[block.trace][block.rows]
        if not np.any(mask):
            continue
        parts.append((block.projected[mask][:, :p], whole[mask]))
    return sandwich(parts, rms_of(parts, p))
