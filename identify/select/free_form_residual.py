"""What a model leaves, as a curve over what it goes with, and which names stand only because that curve was missing.

A torque that no effect of the library describes is taken up by whatever comes near it: a stop by a delay, a gain that
sinks by a lag. A curve fitted beside the model, by the same likelihood and judged by the same evidence, shows both that
something is left and which of the names explain nothing once it is there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from identify.bounds.separation import support_difference
from identify.diagnose.terms.free_form import SHAPE_POINTS
from identify.likelihood.fit import Fit
from identify.model.parameters import Name
from identify.propose.free_forms import fitted, scores, shaft_torque_of, states_of, torque_of
from identify.results import Dependence
from identify.select.evidence import STRONG_SUPPORT, WEIGHT, Evidence, likely_share
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place
from rig.platform import TERMS

if TYPE_CHECKING:
    from identify.select.stepwise import Stepwise

MIN_CURVE_SCORE = 20.0  # of a score, that is worth a fit
CURVES_TRIED = 2  # of the curves with the largest scores
CURVE_STEPS = 14  # iterations of the fit of a curve
MOVED_SIGMAS = 2.0  # standard errors by which a parameter moves
# Of a curve that is no name but may move a parameter: one in a thousand recordings, over ten curves.
CURVE_BY_CHANCE = 1e-4
ON = {
    "free_angle": "angle", "free_rate": "rate", "free_torque": "torque", "free_time": "time",
    "free_gain_over_time": "time", "free_gain_over_speed": "rate", "free_spring_over_time": "time",
    "free_friction_over_angle": "angle", "free_friction_over_time": "time", "free_memory": "history",
}  # fmt: skip


@dataclass(frozen=True)
class FreeFormFit:
    """A curve that belongs beside a model.

    Attributes
    ----------
    now, evidence
        The model without it, and the evidence for it, whose fit has it.
    share
        Of the disturbance that goes with it.
    """

    now: Fit
    evidence: Evidence
    share: float

    @property
    def form(self) -> str:
        """Which curve."""
        return self.evidence.effect

    @property
    def is_there(self) -> bool:
        """Whether it is believed, however little it takes."""
        return self.evidence.support > STRONG_SUPPORT

    @property
    def is_significant(self) -> bool:
        """Whether it is believed, and takes enough."""
        return self.is_there and self.share > WEIGHT

    @property
    def chance_level(self) -> float:
        """How often chance alone makes the cost fall as much, where the curve stands for nothing."""
        parameters = self.evidence.price / np.log(max(self.evidence.fit.count, 2))
        return float(chi2.sf(max(self.evidence.gain / self.evidence.inflation, 0.0), parameters))


def fit_free_forms(search: Stepwise, now: Fit) -> tuple[FreeFormFit | None, list[FreeFormFit]]:
    """The curve that explains most of what a model leaves, None where none explains enough to be believed.

    Besides, the other curves that are there or hardly chance: they take too little to speak against a name, but J may
    be another beside them.
    """
    problem = search.problem
    best: FreeFormFit | None = None
    others: list[FreeFormFit] = []
    found = scores(problem, now, search.trials.scale(now), tuple(effects.free_forms()))[:CURVES_TRIED]
    forms = [form for form in found if form.gain >= MIN_CURVE_SCORE]
    fits = problem.workers.side_by_side([partial(fitted, problem, now, form, CURVE_STEPS) for form in forms])
    found_by = {form.effect: fit for form, fit in zip(forms, fits, strict=True)}
    if (known := search.in_place) is not None and known.structure.minus(known.structure.effects[-1]) == now.structure:
        name = known.structure.effects[-1]
        found_by[name] = min((known, found_by.get(name, known)), key=lambda f: f.cost)
    for name, fit in found_by.items():
        if not np.isfinite(fit.cost):
            continue
        beside = _beside(search, now, fit, name)
        if beside.is_there:
            beside = _beside(search, _from_there(search, now, fit), fit, name)
        if beside.is_significant and (best is None or fit.penalised < best.evidence.fit.penalised):
            best = beside
        # Beside a curve the disturbance may come out larger than without, where it is taken for another colour.
        elif beside.is_there or (beside.share > 0.0 and beside.chance_level < CURVE_BY_CHANCE):
            others.append(beside)
    return best, others


def _beside(search: Stepwise, now: Fit, fit: Fit, form: str) -> FreeFormFit:
    weigher = search.weigher
    return FreeFormFit(now, weigher.evidence(form, now, fit), likely_share(now, fit, weigher.regression.cutoff_hz))


def _from_there(search: Stepwise, now: Fit, fit: Fit) -> Fit:
    """The model without the curve, begun where it stands with it: a curve is not paid for a better place."""
    again = search.problem.fit(now.structure, {**now.values, **fit.values}, fit.noise, CURVE_STEPS, carry=fit.shots)
    return min((now, again), key=lambda f: f.cost)


def redundant_given(search: Stepwise, left: FreeFormFit, names: Sequence[str]) -> str | None:
    """The name that explains least once the curve is there, if that is too little; None where all are needed.

    A curve may hold the effect itself (a spring with a bend is a curve over the angle), so the curve in its place must
    also be clearly likelier, and leave clearly less.
    """
    weakest: tuple[float, str] | None = None
    fit = left.evidence.fit
    there = [name for name in names if name in fit.structure.effects]  # others the curve holds
    for name, without in zip(there, search.all_without(fit, there), strict=True):
        evidence = search.weigher.evidence(name, without, fit)
        cutoff_hz = search.weigher.regression.cutoff_hz
        share = max(evidence.weight, likely_share(without, fit, cutoff_hz))
        better = (
            support_difference(left.now, without) > STRONG_SUPPORT
            and likely_share(left.now, without, cutoff_hz) > WEIGHT
        )
        needless = better and (evidence.support < STRONG_SUPPORT or share < WEIGHT)
        if needless and (weakest is None or evidence.support < weakest[0]):
            weakest = (evidence.support, name)
    return weakest[1] if weakest else None


def dependence_on(search: Stepwise, left: FreeFormFit) -> tuple[Dependence, dict[str, float]]:
    """The curve as the report tells it, and by how much J, C and K are others with it, percent.

    What inertia, damping, stiffness or an effect of the model would take with another size is theirs and not left over:
    beside a spring with a kink, a curve over the angle may have any kink that the spring gives up.
    """
    problem, fit, form = search.problem, left.evidence.fit, left.form
    states = np.concatenate(states_of(problem, fit))
    torque = np.concatenate(torque_of(problem, fit, form))
    acceleration = np.concatenate(
        [np.gradient(s[:, 1], t.step_s) for s, t in zip(states_of(problem, fit), problem.traces, strict=True)]
    )
    counts = np.concatenate([s.weight for s in fit.shots])
    torque, states, acceleration = torque[counts], states[counts], acceleration[counts]
    scale, swing = 0.0, 0.0
    if "gain" in form:
        torque, scale, swing = _without_scale(torque, np.concatenate(shaft_torque_of(fit))[counts])
    sized = [e for e in left.now.structure.effects if _is_sized(e)]  # beside the curve it may have no size at all
    others = [np.concatenate(torque_of(problem, left.now, e))[counts] for e in sized]
    terms = np.column_stack([acceleration, states[:, 1], states[:, 0], np.ones(len(states)), *others])
    size = np.maximum(np.linalg.norm(terms, axis=0), 1e-300)
    as_terms = np.linalg.lstsq(terms / size, torque, rcond=1e-9)[0] / size
    rms = float(np.sqrt(np.mean((torque - terms @ as_terms) ** 2)))
    at, shape = _shape(form, fit)
    moves: dict[str, float] = {}
    for k, term in enumerate(TERMS):
        here, there = left.now.values.get((term,)), fit.values.get((term,))
        if not here or there is None:
            continue
        # Beside dry friction a curve over the rate has any slope at rest; damping is what it grows by in sliding.
        slides = form == "free_rate" and any(effects.get(e).place is Place.FRICTION for e in sized)
        at_rest = _slope(form, term, at, shape)
        moved = there / (1.0 - scale) - here + (float(as_terms[k]) if slides and at_rest else at_rest)
        if ON[form] == "torque":  # what passes on another share of the torque is another scale
            moved = float(as_terms[k])
        elif "gain" in form:  # so is a gain that changes, and nobody knows where along it the recorded torque is right
            moved = max(moved, swing * here, key=abs)
        elif ON[form] == "history":  # a short memory is damping and inertia itself: the platform has both together
            moved += float(as_terms[k])
        if abs(moved) > MOVED_SIGMAS * _error(fit, (term,)):
            moves[term] = 100.0 * abs(moved / here)
    return Dependence(ON[form], rms, rms / problem.torque_nm, left.chance_level, tuple(at), tuple(shape)), moves


def _is_sized(name: str) -> bool:
    """Whether an effect is a torque along the motion that all runs have with one size."""
    effect = effects.get(name)
    along_motion = effect.place in (Place.LOAD, Place.FRICTION) and effect.reads is None
    return along_motion and not any(p.per_run for p in effect.parameters)


def _without_scale(resisted: Array, torque: Array) -> tuple[Array, float, float]:
    """What a gain that changes takes of a torque beside what it takes of all of it, the latter, and the largest change.

    A torque that is passed on by the same share throughout is one on another scale, with J, C and K on that, too.
    """
    scale = float(np.dot(resisted, torque) / max(float(np.dot(torque, torque)), 1e-300))
    if not scale < 1.0:
        return resisted, 0.0, 0.0
    beside = (resisted - scale * torque) / (1.0 - scale)
    large = np.abs(torque) > np.sqrt(np.mean(torque**2))
    return beside, scale, float(np.max(np.abs(beside[large] / torque[large]), initial=0.0))


def _error(fit: Fit, name: Name) -> float:
    error = fit.std_error(name)
    return error if np.isfinite(error) else 0.0


def _slope(form: str, term: str, at: Sequence[float], shape: Sequence[float]) -> float:
    """What a curve over the angle or the rate adds to the stiffness or the damping at rest."""
    if (form, term) not in (("free_angle", "stiffness"), ("free_rate", "damping")):
        return 0.0
    slopes = np.gradient(np.array(shape), np.array(at))
    return float(np.interp(0.0, at, slopes))


def _shape(form: str, fit: Fit) -> tuple[list[float], list[float]]:
    """Where a curve is shown and its torque there; nothing of a curve that is the gain of something else."""
    if form not in ("free_angle", "free_rate", "free_torque", "free_time"):
        return [], []
    own: Array = np.array([fit.values[(form, p.name)] for p in effects.get(form).parameters])
    places = np.linspace(own[0], own[1], len(own) - 1)  # begin, end, constant, inner values
    values = np.concatenate([[0.0], own[3:], [0.0]])
    at = np.linspace(own[0], own[1], SHAPE_POINTS)
    return at.tolist(), np.interp(at, places, values).tolist()


def curves_left(
    search: Stepwise, most_percent: Mapping[str, float]
) -> list[tuple[Dependence, dict[str, float]]]:  # fmt: skip
    """What curves over the torque that is left show: the likeliest that is believed, and the one J, C or K hang on."""
    there = search.left or min(
        (c for c in search.doubtful if c.is_there), key=lambda c: c.evidence.fit.penalised, default=None
    )
    moving = most_moving(search, [c for c in search.doubtful if c is not there], most_percent)
    believed = [] if there is None else [dependence_on(search, there)]
    return believed if moving is None else [*believed, moving]


def most_moving(
    search: Stepwise, curves: Sequence[FreeFormFit], most_percent: Mapping[str, float]
) -> tuple[Dependence, dict[str, float]] | None:
    """Of curves beside a model the one that moves J, C or K farthest beyond what is allowed; None where none does."""
    dependences = [dependence_on(search, c) for c in curves]

    def excess(curve: tuple[Dependence, dict[str, float]]) -> float:
        return max((moved / most_percent[term] for term, moved in curve[1].items()), default=0.0)

    worst = max(dependences, key=excess, default=None)
    return worst if worst is not None and excess(worst) > 1.0 else None
