"""Each set for itself, and all sets together, by the paper's genetic algorithm (Eq. 12-14, Tab. 1 and 2).

The effects of the final model are taken off the torque first, along the motion that the final model makes,
so that J, C and K of a set answer to a linear equation; e(k) of Eq. 12 is its prefiltered residual. The
objective is then a quadratic form whose cost does not grow with the number of samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from identify.bounds.cramer_rao import information_of
from identify.estimate.final_fit import FinalFit, _regression_covariance
from identify.estimate.initial_guess import Start
from identify.estimate.initial_state_sensitivity import least_std_errors
from identify.estimate.output_error import refine
from identify.estimate.regression import Regression, RegressionFit, fit, normal
from identify.genetic.algorithm import QuadraticObjective, search
from identify.genetic.linear_traces import linear_traces
from identify.model.parameters import Name, platform_of
from identify.model.structure import Structure
from identify.results import UNITS, GeneticRun, ParameterEstimate, SetResult
from identify.signals.prefilter import Denominator
from identify.signals.trace import Trace
from rig.config.identify import IdentifyConfig
from rig.platform import TERMS
from rig.recording.run import Array

ALLOWANCE = 1.2  # J_dec over the objective that the sensor's noise alone makes
# The same over the closed form's, where that lies higher and yet is near the noise: no search gets lower.
ARRIVED = 1.02
NEAR_NOISE = 2.0  # times the objective that the noise makes
SIMULATION_ITERATIONS = 8  # iterations of the fit that a set's values are held against
MAX_SIGMAS = 3.0  # standard errors from it: further off, the distance is the error
SET_DETERMINED_RELATIVE_ERROR = 0.05  # relative standard error up to which a set alone determines a parameter
KEYS = {"inertia": "inertia_kg_m2", "damping": "damping_nm_s_rad", "stiffness": "stiffness_nm_rad"}


@dataclass(frozen=True)
class Condensed:
    """One regression condensed to its normal equations, at its own filter."""

    objective: QuadraticObjective
    terms: tuple[str, ...]
    count: int
    floor: float  # sum of squares that the sensor's noise makes
    solution: RegressionFit | None  # that its filter comes from, unless it is plain


def condense(
    traces: Sequence[Trace], terms: tuple[str, ...], start: Start, rho: float, plain: bool = False
) -> Condensed:
    """Normal equations of the linear model, prefiltered to white (or, ``plain``, as bare equation error)."""
    regression = Regression(traces, Structure(terms))
    solution: RegressionFit | None = None
    if plain:
        w = 2.0 * np.pi * start.cutoff_hz  # a low-pass on both sides, as section 3 of the paper filters
        denominator = Denominator(1.0, 1.4 * w, w * w)
    else:
        solution = fit(regression, {}, start.platform, rho, 8)
        denominator = solution.denominator
    equations = normal(regression.blocks(denominator, {}))
    kept = tuple(label[0] for label in regression.labels)
    noise = float(np.mean([t.noise**2 for t in traces]))
    objective = QuadraticObjective(equations.a, equations.b, equations.c)
    return Condensed(objective, kept, equations.count, noise * equations.count, solution)


def genetic(
    name: str, traces: Sequence[Trace], terms: tuple[str, ...], start: Start, centre: Mapping[str, float],
    settings: IdentifyConfig, seed: int, rho: float, beside: bool, condensed: Condensed | None = None,
) -> GeneticRun:  # fmt: skip
    """The paper's search on one set (or all), with the closed form beside it.

    ``centre`` are the values around which the range spans ``search_factor`` either way; ``beside`` also runs
    Eq. 13 alone and the plain equation error, to be reported next to it. ``condensed`` is what ``condense`` makes
    of all this, where somebody has it already.
    """
    condensed = condensed or condense(traces, terms, start, rho)
    goal = condensed.objective
    low, high = search_range(condensed.terms, goal.closed_form, centre, settings.genetic.search_factor)
    chosen = (
        condense(traces, terms, start, rho, plain=True).objective if settings.genetic.objective == "plain" else goal
    )
    j_dec = settings.j_dec if settings.j_dec is not None else _j_dec(goal.minimum, condensed.floor)
    outcome = search(chosen, low, high, settings.genetic, np.random.default_rng(seed), j_dec)

    def named(x: Array) -> dict[str, float]:
        return dict(zip(condensed.terms, (float(v) for v in x), strict=True))

    roulette: dict[str, float] = {}
    plain: dict[str, float] = {}
    if beside:
        bare = settings.genetic.model_copy(update={"elitism": False, "shrinking_mutation": False, "restarts": 0})
        roulette = named(search(chosen, low, high, bare, np.random.default_rng(seed)).best)
        once = settings.genetic.model_copy(update={"restarts": 0})
        other = condense(traces, terms, start, rho, plain=True).objective
        plain = named(search(other, low, high, once, np.random.default_rng(seed)).best)
    return GeneticRun(
        name, named(outcome.best), named(chosen.closed_form), named(chosen.gap_percent(outcome.best)),
        float(outcome.objective), float(j_dec), outcome.restarts, bool(outcome.objective < j_dec),
        outcome.history, roulette, plain, chosen.minimum,
    )  # fmt: skip


def _j_dec(minimum: float, floor: float) -> float:
    """Below which a search has arrived, where nobody says: near the noise's share, or the closed form's above it."""
    near = minimum < NEAR_NOISE * floor
    return max(ALLOWANCE * floor, ARRIVED * minimum) if near else ALLOWANCE * floor


def has_arrived(run: GeneticRun) -> bool:
    """Whether a search has come as low as its objective goes."""
    lowest = run.closed_form_objective
    return lowest is not None and run.objective <= ARRIVED * lowest


def search_range(
    terms: Sequence[str], optimum: Array, centre: Mapping[str, float], factor: float
) -> tuple[Array, Array]:
    """From a tenth to ten times the declared value, widened to hold the data's own optimum well inside."""
    low, high = [], []
    for term, best in zip(terms, optimum, strict=True):
        declared = abs(centre.get(term, 0.0)) or abs(best) or 1.0
        top = factor * max(declared, abs(best))
        bottom = 0.0 if best >= 0.0 else -top
        low.append(bottom)
        high.append(top)
    return np.array(low), np.array(high)


def _platform(fitted: FinalFit) -> tuple[float, float, float]:
    inertia, damping, stiffness = (fitted.values.get((t,), 0.0) for t in TERMS)
    return inertia, damping, stiffness


def each_set(
    traces: Sequence[Trace], fitted: FinalFit, start: Start, centre: Mapping[str, float],
    settings: IdentifyConfig, axis: str,
) -> tuple[tuple[SetResult, ...], GeneticRun | None]:  # fmt: skip
    """Every run fitted for itself, and all of them together; nothing where no torque was measured."""
    if any(t.torque is None for t in traces):
        return (), None
    linear = linear_traces(traces, fitted)
    terms = fitted.structure.terms
    # Without an inertia there is nothing to filter with: what was guessed first has one.
    begin = replace(start, platform=_platform(fitted)) if _platform(fitted)[0] > 0.0 else start
    whole = [replace(t, number=i) for i, t in enumerate(linear)]
    bounds = _bounds(traces, fitted) if fitted.sensor_limited and fitted.structure.effects else [{} for _ in traces]
    rho = 0.0 if fitted.sensor_limited else start.rho

    def alone(i: int) -> SetResult:
        trace = whole[i]
        seed, condensed = settings.seed + i, condense([trace], terms, begin, rho)
        run = genetic(trace.run.name, [trace], terms, begin, centre, settings, seed, rho, False, condensed)
        assert condensed.solution is not None
        return _result(trace, run, condensed.solution, terms, begin.platform, axis, bounds[i])

    with ThreadPoolExecutor(2) as workers:
        joint = workers.submit(
            genetic, "all sets", whole, terms, begin, centre, settings, settings.seed, rho, True
        )  # fmt: skip
        return tuple(workers.map(alone, range(len(whole)))), joint.result()


def _by_motion(trace: Trace, values: Mapping[str, float], labels: Sequence[Name]) -> tuple[Array, Array]:
    """What whole-run simulation makes of a set's values, (p,), and the errors that its noise allows, (p,).

    The sensor's noise in the regression's columns passes for motion: its own errors are too small, and where little
    tells two terms apart its values are off as well.
    """
    at = np.array([values[term] for (term,) in labels])
    lost = at, np.full(len(labels), np.inf)
    structure = Structure(tuple(term for (term,) in labels))
    if values.get("inertia", 1.0) <= 0.0:
        return lost
    start: dict[Name, float] = {(term,): values[term] for (term,) in labels}
    found = refine([replace(trace, number=0)], structure, start, None, SIMULATION_ITERATIONS, coarse=True)
    if not np.isfinite(found.sigma):
        return lost
    errors = least_std_errors(found.shots[0], found, labels, trace.noise)
    return np.array([found.values[label] for label in labels]), errors


def _is_known(value: float, error: float) -> bool:
    return error < SET_DETERMINED_RELATIVE_ERROR * max(abs(value), 1e-300)


def _tied(
    trace: Trace, errors: Array, labels: Sequence[Name], values: Mapping[str, float],
    platform: tuple[float, float, float],
) -> Array:  # fmt: skip
    """Errors, (p,), that know of each other: at one frequency inertia and stiffness are one number, K - J w^2.

    Where a set does not tell the one, the other is off by as much as all of it (``platform``, of all sets) makes there.
    """
    out = errors.copy()
    square = float(np.var(trace.fine[1]) / max(float(np.var(trace.fine[0])), 1e-300))
    inertia, _, stiffness = platform
    for lost, other, reach in (
        ("inertia", "stiffness", inertia * square), ("stiffness", "inertia", stiffness / max(square, 1e-300)),
    ):  # fmt: skip
        if (
            (lost,) in labels
            and (other,) in labels
            and not _is_known(values[lost], float(errors[labels.index((lost,))]))
        ):
            out[labels.index((other,))] = max(out[labels.index((other,))], abs(reach))
    return out


def _bounds(traces: Sequence[Trace], fitted: FinalFit) -> list[dict[str, float]]:
    """Standard errors of J, C, K that each set allows where its effects are not known better than it tells."""
    values = np.array(list(fitted.values.values()))
    out = []
    for trace in traces:
        platform = platform_of(fitted.structure, tuple(fitted.values), values, trace.number)
        bound = information_of(replace(trace, number=0), platform)
        out.append({n[0]: bound.std_error(n) for n in bound.names if len(n) == 1})
    return out


def _result(
    trace: Trace, run: GeneticRun, solution: RegressionFit, terms: tuple[str, ...],
    platform: tuple[float, float, float], axis: str, bound: Mapping[str, float],
) -> SetResult:  # fmt: skip
    mask = [trace.keep]
    covariance, determined = _regression_covariance([trace], solution, mask)
    simulated, least = _by_motion(trace, run.parameters, solution.names)
    errors = np.maximum(np.sqrt(np.maximum(np.diag(covariance), 0.0)), least)
    errors = np.maximum(errors, [bound.get(term, 0.0) for (term,) in solution.names])
    apart = np.abs(simulated - [run.parameters[term] for (term,) in solution.names])
    errors = np.where(apart > MAX_SIGMAS * errors, apart, errors)
    errors = _tied(trace, errors, solution.names, run.parameters, platform)
    parameters, identifiable = {}, []
    for i, (term,) in enumerate(solution.names):
        value, error = run.parameters[term], float(errors[i])
        if not (determined[i] and _is_known(value, error)):
            continue
        identifiable.append(term)
        parameters[term] = ParameterEstimate.normal(value, error, UNITS[axis][term])
    missing = [t for t in terms if t not in identifiable]
    advice = (
        f"{trace.run.name} alone does not determine {' and '.join(missing)}: keep the start transient "
        "or fit it together with another frequency" if missing else ""
    )  # fmt: skip
    return SetResult(
        trace.run.name, trace.run.frequency_hz, parameters, run.objective, run.restarts, run.accepted,
        tuple(identifiable), advice, run,
    )  # fmt: skip
