"""Whether a term or an effect is needed, and an effect in place of damping or stiffness where that is likelier."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identify.bounds.separation import support_difference
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.select.evidence import PREDICTS_TO_NOISE, STRONG_SUPPORT, WEIGHT, Evidence
from identify.select.lags import takes_damping
from identify.select.preference import simplest
from identify.select.trial_fits import FULL_ITERATIONS, TRIAL_ITERATIONS
from identify.wording import plain
from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS

if TYPE_CHECKING:
    from identify.select.stepwise import Stepwise

OFFSET = "torque_offset"  # what gravity has besides, where it stands for a spring that bends
NEEDED_TERM_SIGMAS = 30.0  # standard errors beyond which a term is needed, and no effect is tried in its place


def with_others_in_place(search: Stepwise, now: Fit) -> Fit:
    """With other effects in the place of a term, and of one that cancels a term."""
    return without_cancelled_stiffness(search, replace_linear_terms(search, now))


def replace_linear_terms(search: Stepwise, now: Fit) -> Fit:
    """With an effect instead of damping or stiffness, where that is likelier: a drag is no viscous friction.

    Beside the term such an effect explains little, and the other way round.
    """
    for term in ("damping", "stiffness"):
        if term not in now.structure.terms or abs(now.values[(term,)]) >= NEEDED_TERM_SIGMAS * now.std_error((term,)):
            continue
        rest = search.without(now, term)
        fits = search.trials.score_round(rest, rest.cost - now.cost)[1]
        fits = {
            n: f for n, f in fits.items()
            if len(f.names) <= len(now.names) and support_difference(now, f) > STRONG_SUPPORT
            and set(now.structure.effects) <= set(f.structure.effects)
        }  # fmt: skip
        if not fits:
            continue
        best = min(fits.values(), key=lambda f: f.penalised)
        name = simplest(search.weigher, {n: f for n, f in fits.items() if support_difference(f, best) < STRONG_SUPPORT})
        evidence = search.weigher.evidence(name, rest, fits[name])
        if evidence.support < STRONG_SUPPORT or evidence.weight < WEIGHT or _goes_with(search, term, now, fits[name]):
            continue
        if (without := _needless_beside(search, term, fits[name])) is not None:
            now = without
            continue
        search.dropped.append((term, f"{plain(name)} explains more in its place"))
        search.say(f"replaced {term} by {plain(name)}")
        now, search.inflation[name] = fits[name], evidence.inflation
    return now


def without_cancelled_stiffness(search: Stepwise, now: Fit) -> Fit:
    """With another effect instead of one that cancels most of the spring, where that does as well without.

    Within a small travel gravity is a spring that bends, and a constant. Against a spring several times too stiff it
    stands for any cubic spring with an offset, as likely and with no more numbers; nobody builds such a rig.
    """
    for name in search.trials.added(now):
        for rival, as_rival in (effects.get(name).as_rival or {}).items():
            there = as_rival(tuple(now.values[(name, p.name)] for p in effects.get(name).parameters))
            spring, added = now.values.get(("stiffness",), 0.0), there.terms.get("stiffness", 0.0)
            cancelled = added * spring < 0.0 and abs(added) > abs(spring + added)
            if not cancelled or rival in now.structure.effects or rival not in search.allowed:
                continue
            start: dict[Name, float] = {**now.without(name), ("stiffness",): spring + added}
            start |= {(rival, own): value for own, value in there.own.items()}
            less = now.structure.minus(name)
            structures = [less.plus(rival)]
            if OFFSET in search.allowed and OFFSET not in less.effects:
                structures.append(less.plus(rival, OFFSET))
            for structure in structures:
                fit = search.problem.fit(structure, start, now.noise, FULL_ITERATIONS, carry=now.shots)
                if np.isfinite(fit.cost) and support_difference(fit, now) < STRONG_SUPPORT:
                    search.say(f"replaced {plain(name)} by {plain(rival)}: it does as well beside a weaker spring")
                    return fit
    return now


def _needless_beside(search: Stepwise, term: str, instead: Fit) -> Fit | None:
    """The model with the term again and without one of its effects, where that does as well; None where none does.

    Two effects may share what a term does: a creep that settles within the motion damps it, and a delay turns the phase
    that is left over.
    """
    terms = tuple(t for t in TERMS if t in (*instead.structure.terms, term))
    fits: list[tuple[str, Fit]] = []
    for name in search.trials.added(instead):
        structure = replace(instead.structure.minus(name), terms=terms)
        start = {**search.base.values, **instead.values}
        fits.append((name, search.problem.fit(structure, start, instead.noise, FULL_ITERATIONS, thorough=False)))
    fits = [(n, f) for n, f in fits if np.isfinite(f.cost) and support_difference(f, instead) < STRONG_SUPPORT]
    if not fits:
        return None
    name, best = min(fits, key=lambda both: both[1].penalised)
    search.say(f"dropped {plain(name)}: {term} does as well in its place")
    return best


def _goes_with(search: Stepwise, term: str, now: Fit, instead: Fit) -> bool:
    """Whether a model with an effect in the place of a term is likelier still with both."""
    start = {**instead.values, (term,): now.values[(term,)]}
    structure = now.structure.plus(*(e for e in instead.structure.effects if e not in now.structure.effects))
    both = search.problem.fit(structure, start, instead.noise, TRIAL_ITERATIONS, carry=instead.shots, thorough=False)
    return support_difference(instead, both) > STRONG_SUPPORT


def stiffness_may_absorb(problem: PredictionError, now: Fit) -> bool:
    """Whether the spring is so weak that it may only soak up what is constant over a run, or pushes."""
    pull = now.values.get(("stiffness",), 0.0) * problem.angle_rad
    return now.reduced_chi_square > PREDICTS_TO_NOISE and pull < WEIGHT * problem.torque_nm


def without_absorbing_stiffness(search: Stepwise, now: Fit) -> Fit:
    """The same without a spring that only soaks up what is constant: gravity is a spring of its own."""
    if "stiffness" not in now.structure.terms or not stiffness_may_absorb(search.problem, now):
        return now
    without = search.without(now, "stiffness")
    evidence = search.weigher.evidence("stiffness", without, now)
    return without if evidence.support < STRONG_SUPPORT or evidence.weight < WEIGHT else now


def is_in_doubt(search: Stepwise, now: Fit, name: str) -> bool:
    """Whether it is in doubt that a term or an effect is needed."""
    if name == "inertia":
        return False
    if name == "stiffness" and stiffness_may_absorb(search.problem, now):
        return True
    if name in TERMS:
        return abs(now.values[(name,)]) < NEEDED_TERM_SIGMAS * now.std_error((name,))
    return search.needed.get(name, 0.0) < NEEDED_TERM_SIGMAS**2


def is_light(search: Stepwise, evidence: Evidence, without: Fit, now: Fit) -> bool:
    """Whether a term or an effect carries too little torque.

    A lag or a delay is asked when it is added: what was found since, or the damping, may hide it in torque, and never
    in the likelihood.
    """
    name = evidence.effect
    if name in TERMS:
        soaks = name == "stiffness" and stiffness_may_absorb(search.problem, now)
        return soaks and evidence.weight < WEIGHT
    effect = effects.get(name)
    if effect.place is Place.SENSOR or effect.delay_s is not None:
        return takes_damping(name, without, now)
    return evidence.weight < WEIGHT


def needless(search: Stepwise, now: Fit, doubted: Sequence[str]) -> list[tuple[Evidence, bool]]:
    """What speaks for each of those that the data do as well without, and whether it carries little torque."""
    found = []
    lags = any(effects.get(e).lag is not None for e in now.structure.effects)
    for name, without in zip(doubted, search.all_without(now, doubted), strict=True):
        if not np.isfinite(without.cost):  # it runs away without
            continue
        # Beside a lag of the gyro a residual in torque hides what was believed when it was added.
        evidence = search.weigher.evidence(name, without, now, benefit_of_doubt=lags and name not in TERMS)
        light = is_light(search, evidence, without, now)
        if evidence.support <= STRONG_SUPPORT or light:
            found.append((evidence, light))
    return found
