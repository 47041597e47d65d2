"""The search where a torque that nobody recorded limits the runs: in torque, the final models by prediction error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from scipy.linalg import block_diag

from identify.diagnose.disturbance import beside, disturbance_of
from identify.diagnose.torque_fit import TorqueErrors, TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.covariance import covariance_of
from identify.estimate.final_fit import FinalFit, free_run_of
from identify.estimate.initial_guess import Start, scale_of
from identify.likelihood.by_prediction_error import as_final, fitted_on_all
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.results import Dependence, Disturbance
from identify.runs.holdout import Split
from identify.runs.observability import can_show
from identify.runs.reduced import reduced
from identify.select.curve_rivals import not_as_strong
from identify.select.evidence import MAX_TRUSTED_INFLATION, STRONG_SUPPORT, in_band, inflation, torque_fit_of
from identify.select.lags import SensorPart
from identify.select.likelihood_search import MAX_CUTOFF_SHARE, MIN_MORE_SAMPLES_RATIO
from identify.select.preference import follows_nothing_freely, is_more_flexible, leaves_less
from identify.select.search_state import Found, Search, describes
from identify.select.torque_search import TorqueSearch
from identify.signals.trace import Trace, release
from identify.wording import joined, plain
from rig import effects
from rig.effects.base import Place

MUCH_LEFT = 0.05  # of the torque: where nothing explains that, a wider band is looked at
# Times the cut-off at which the sensor's noise is ten times as much torque: an angle is differentiated twice.
WIDER = {"angle": 10.0**0.4, "rate": 10.0 ** (2.0 / 3.0)}
UNFOLLOWED = 0.5  # of the residual in torque, that the likelihood takes the disturbance for
NO_WORSE = 1.02  # times the residual in torque: prediction error leaves no more
WHOLE_SAMPLES = 200_000  # in which what is left is looked at: memory is a gibibyte for so many
A_MULTIPLE = 2.0  # of the residual in torque: four times its power is no disturbance, whatever the likelihood says


@dataclass(frozen=True)
class Judged:
    """A model as the likelihood judges it.

    Attributes
    ----------
    fit, search
        The model, and the search as the report tells it.
    curves
        What curves over what it leaves show, and how far J, C and K move with each, percent.
    """

    fit: Fit
    search: Search
    curves: Sequence[tuple[Dependence, Mapping[str, float]]] = ()


def search_in_torque(
    traces: Sequence[Trace], split: Split, structure: Structure, shapes: dict[str, tuple[float, ...]], start: Start,
    allowed: Sequence[str], unit: str, say: Callable[[str], None], known: Judged, trusted: bool,
    along_few: TorqueRegression, refutes: Callable[[Structure, Mapping[Name, float]], bool],
) -> Found:  # fmt: skip
    """Find what the declared model lacks, and fit both models with their disturbance.

    Parameters
    ----------
    structure, shapes
        The declared model, and the shapes of its effects.
    start
        A first idea of the platform.
    allowed
        Names of the effects that may be named.
    unit
        Of the torque.
    known
        The model that the search by prediction error has found. It stands where what it leaves depends on nothing, or
        where the search in torque leaves as much on held-out samples.
    trusted
        Whether its likelihood is right about the disturbance: then a model that it leaves little of stands, though its
        effects cannot be followed along the measured motion (a play, a hysteresis).
    along_few
        The samples that search looked at, in torque.
    refutes
        Whether that model is likelier than one found in torque: the search in torque proposes, the likelihood judges.
    """
    few, parts, sensors = along_few.traces, along_few.split, SensorPart.of(known.fit, structure)
    scale = scale_of(few, start.platform, ())
    offered = [n for n in allowed if n not in structure.effects and can_show(n, traces)]

    def at(cutoff_hz: float) -> TorqueSearch:
        same = cutoff_hz == along_few.cutoff_hz
        regression = along_few if same else TorqueRegression(few, parts, cutoff_hz, scale)
        base = sensors.begun(regression, shapes)
        floor = regression.noise_floor_nm(base.values)
        acceleration = float(np.sqrt(np.mean(regression.series()[2] ** 2)))
        return TorqueSearch(regression, base, floor, acceleration, offered, say)

    highest = MAX_CUTOFF_SHARE / few[0].step_s
    search = at(min(start.cutoff_hz, highest))
    trial = torque_fit_of(search.regression, known.fit)
    by_likelihood: Judged | None = known
    best = trial
    size_nm = float(np.sqrt(in_band(known.fit.noise, search.regression.cutoff_hz) * known.fit.variance))
    unfollowed = trusted and bool(known.fit.structure.effects) and size_nm < UNFOLLOWED * trial.held_nm
    if not unfollowed:
        say("looking at what is left as a torque")
        depends = bool(known.curves or disturbance_of(search.regression, trial, search.floor_nm, unit).depends_on)
        search.run()

        def is_better(proposed: TorqueFit) -> bool:
            added = [e for e in proposed.structure.effects if e not in search.base.structure.effects]
            if not leaves_less(search, proposed, trial, depends) or not_as_strong(proposed, added):
                return False
            if trial.held_nm > A_MULTIPLE * proposed.held_nm and follows_nothing_freely(proposed, trial):
                return True
            return not (trusted and is_more_flexible(proposed, trial)) and not refutes(*sensors.put_back(proposed))

        # A lag at the end of the way is no reason to give away what was found before it.
        proposed = next(filter(is_better, reversed(search.path)), None)
        if proposed is not None:
            by_likelihood, best = None, proposed
    left = best.held_nm / search.regression.torque_nm
    if by_likelihood is None and best.structure.effects == search.base.structure.effects and left > MUCH_LEFT:
        wider = min(WIDER[few[0].channel] * start.cutoff_hz, highest)
        say(f"nothing found up to {start.cutoff_hz:.3g} Hz: looking up to {wider:.3g} Hz")
        search = at(wider)
        best = search.run()
    regression, base, floor, cutoff = search.regression, search.base, search.floor_nm, search.regression.cutoff_hz
    final, begin = (by_likelihood.fit.structure, {}) if by_likelihood else sensors.put_back(best)
    say(f"final fit with {joined([plain(e) for e in final.effects]) or 'fewer terms'}")
    # In torque the shapes of declared effects stay as they are declared: the likelihood has fitted them.
    shaped = by_likelihood is not None and known.fit.structure == structure and any(shapes.values())
    if sensors.names:  # the declared model has no part in the sensor
        base = regression.solve(structure, shapes)
    begun, like = (known.fit.values, known.fit) if shaped else (base.values, None)
    likely = fitted_on_all(traces, structure, begun, split.final, like)
    before = _final(regression, base, likely, traces, split, trusted=shaped)

    def fitted(final: Structure) -> FinalFit:
        if final == structure:
            return before
        found_by_it = by_likelihood is not None or final == known.fit.structure  # what torque had beside it was dropped
        its = known.fit if found_by_it else None
        likely = fitted_on_all(traces, final, its.values if its else {**best.values, **begin}, split.final, its)
        return _final(regression, best, likely, traces, split, trusted=found_by_it, unfollowed=unfollowed)

    after, found_so_far = fitted(final), final
    while name := _unsupported(after, structure, bool(by_likelihood)):
        say(f"dropped {plain(name)}: in the final fit its size does not differ significantly from zero")
        final, best = final.minus(name), search.without(best, name)
        after = fitted(final)
    disturbance = _with_whole(disturbance_of(regression, best, floor, unit), regression, best, traces, split, unit)
    lost = [e for e in final.effects if e not in best.structure.effects and effects.get(e).place is not Place.SENSOR]
    if by_likelihood and (unfollowed or lost):
        disturbance = Disturbance(size_nm, unit, size_nm / regression.torque_nm, (), {})
    if describes(known.fit, after):
        for curve in known.curves:
            disturbance = disturbance.with_free_form(*curve)

    def errors(fit: TorqueFit) -> TorqueErrors:
        size = regression.torque_nm
        return TorqueErrors(fit.sigma, fit.sigma / size, fit.held_nm / size, floor, cutoff)

    in_torque: dict[tuple[object, ...], TorqueFit] = {(None,): best}  # by others, and by what was taken back

    def lacking(*several: str, others: str | None = None) -> tuple[FinalFit, TorqueErrors, Disturbance]:
        less, there = final, best
        for name in several:
            less, there = less.minus(name), search.without(there, name)
        values = {k: v for k, v in after.values.items() if k[0] not in several}
        there, added = (there, []) if others is None else search.with_others(there, several, others)
        model = replace(less, terms=there.structure.terms).plus(*(c.effect for c in added)) if added else less
        fitted = before
        if model.effects != structure.effects:
            like = after.fit if isinstance(after.fit, Fit) else None
            likely = fitted_on_all(traces, model, {**there.values, **values}, split.final, like)
            fitted = _final(regression, there, likely, traces, split, trusted=like is not None, unfollowed=unfollowed)
        reported.candidates += [c for c in added if c not in reported.candidates]
        reported.contribution |= {c.effect: search.without(there, c.effect).held_nm / there.held_nm for c in added}
        in_torque[(others, *several)] = there
        return fitted, errors(there), disturbance_of(regression, there, floor, unit)

    def share_of(names: Sequence[str], *gone: str, others: str | None, part: Dependence | None) -> float:
        there = in_torque[(others, *gone)]
        if not set(names) & set(there.structure.effects):
            return float("inf")
        both: tuple[TorqueFit, ...] = (there, reduce(search.without, names, there))
        if part is not None and not (both := beside(regression, there, part, both[1])):
            return 0.0
        return (both[1].held_nm ** 2 - both[0].held_nm ** 2) / regression.torque_nm**2

    reported = search.as_search(best)
    if by_likelihood is None and sensors.names:
        reported.add_found(known.search, sensors.names)
        reported.best = replace(best, structure=final)
    elif by_likelihood is not None:
        # Where the residual in torque is mostly errors of the measured motion, it says nothing of what a name takes.
        reported = replace(by_likelihood.search, contribution={} if unfollowed else reported.contribution)
        if final != found_so_far:
            reported.drop(after.fit)
    return Found(reported, before, after, disturbance, (errors(base), errors(best)), lacking, share_of)


def _with_whole(
    disturbance: Disturbance, regression: TorqueRegression, fit: TorqueFit, traces: Sequence[Trace], split: Split,
    unit: str,
) -> Disturbance:  # fmt: skip
    """The same with what the whole recording shows to change along runs, or between them.

    A part of it need not show that; what goes with the motion shows in any part.
    """
    whole, parts = reduced(traces, split, WHOLE_SAMPLES)
    if sum(t.count for t in whole) < MIN_MORE_SAMPLES_RATIO * sum(t.count for t in regression.traces):
        return disturbance
    wider = TorqueRegression(whole, parts, regression.cutoff_hz, regression.scale)
    there = wider.solve(fit.structure, fit.shapes)
    left = disturbance_of(wider, there, wider.noise_floor_nm(there.values), unit, "time")
    for part in left.depends_on:  # as a share of the same torque as the rest
        alike = replace(part, relative=part.torque_rms / regression.torque_nm)
        disturbance = disturbance.with_free_form(alike, left.moves_percent)
    release(whole)
    return disturbance


def _unsupported(final: FinalFit, declared: Structure, by_likelihood: bool) -> str | None:
    """Of the effects that were found, the one that the final fit supports least, if too little; else None.

    The final fit asks again what the likelihood has named. Of what the search in torque has named it is asked only
    about effects that can follow almost anything: of others a slow disturbance may leave it unsure (a constant torque)
    though samples that were not fitted show them.
    """
    found = [e for e in final.structure.effects if e not in declared.effects]
    builds_on = {lower for e in found for lower in effects.get(e).lower_order}
    asked = [e for e in found if e not in builds_on and (by_likelihood or effects.get(e).is_flexible)]
    weakest = min(asked, key=final.support_of, default=None)
    return weakest if weakest is not None and final.support_of(weakest) < STRONG_SUPPORT else None


def _final(
    regression: TorqueRegression, fit: TorqueFit, likely: tuple[PredictionError, Fit], traces: Sequence[Trace],
    split: Split, trusted: bool = False, unfollowed: bool = False,
) -> FinalFit:  # fmt: skip
    """The final fit by prediction error, or in torque where that leaves less and the likelihood is not to be believed.

    Prediction error is the better estimate as long as what is left is a disturbance: in a closed loop that goes with
    the motion, and least squares takes it for inertia. Where the scores of the parameters scatter by more than the
    likelihood takes them to, what is left is none. Prediction error then weighs the frequencies at which the model
    happens to be right and gives the rest away; least squares in torque does the least harm to the parameters. The same
    where it leaves a multiple: a handful of parameters takes nothing of that kind away from a disturbance that is one.
    (A friction that is no step at a reversal has a small level there, and the rest of it passes for a slow torque.)
    ``trusted``: the likelihood found the model. ``unfollowed``: most of what that leaves in torque are errors of the
    measured motion, which say nothing against it.
    """
    problem, found = likely
    fitted = as_final(problem, found, traces, split.everything)
    if trusted and unfollowed:
        return fitted
    if any(effects.get(e).place is Place.SENSOR for e in found.structure.effects):  # of which torque knows the less
        return fitted
    left = regression.left_by(fit.structure, fitted.values)
    trusted = trusted or inflation(problem.columns_at(found, with_variance=True), found, found.names) < (
        MAX_TRUSTED_INFLATION
    )
    if left <= (A_MULTIPLE if trusted else NO_WORSE) * fit.sigma:
        return fitted
    columns, residuals, names = regression.linear_parts(fit.structure, fit.values)
    covariance, determined = covariance_of(list(zip(columns, residuals, strict=True)), len(names))
    shapes = [n for n in fit.values if n not in names]
    covariance = block_diag(covariance, np.diag([fitted.std_error(n) ** 2 for n in shapes])) if shapes else covariance
    values = {n: fit.values[n] for n in (*names, *shapes)}
    free = free_run_of(traces, fit.structure, values, split.everything)
    return FinalFit(
        fit, values, (*names, *shapes), covariance, free, False, (*determined, *(True for _ in shapes)),
        "least squares in torque",
    )  # fmt: skip
