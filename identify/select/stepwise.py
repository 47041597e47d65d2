"""The search: effects added one at a time to a model fitted by prediction error, each judged again beside the others.

Every model has its own disturbance. While an effect is missing its torque counts as disturbance and the prediction
leans on the measurements; as effects are found the disturbance shrinks, down to the sensor's noise where all is found.
So one likelihood judges all models, of simulated rigs and of real ones, from the first that lacks everything to the
last. What it says is scaled by how far it can be believed, and a name takes weight besides (``evidence``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np

from identify.bounds.between_models import model_spread
from identify.bounds.separation import support_difference
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.innovation_score import Score
from identify.select.curve_rivals import against_curves, not_as_strong, seen_too_little
from identify.select.evidence import ADDED_SUPPORT, STRONG_SUPPORT, WEIGHT, Evidence, EvidenceModel, is_trusted
from identify.select.forward_selection import Round, add_effects, begin_again_without, gone_on_without
from identify.select.free_form_residual import FreeFormFit, fit_free_forms, redundant_given
from identify.select.lags import drives
from identify.select.needed_terms import is_in_doubt, needless, with_others_in_place, without_absorbing_stiffness
from identify.select.preference import explains_most, no_possible_gain, prefers_special_case, simplest
from identify.select.trial_fits import FULL_ITERATIONS, TRIAL_ITERATIONS, TrialFits
from identify.wording import plain
from rig import effects
from rig.arrays import Array
from rig.platform import TERMS

PROMISING = 0.1  # of the score of what was added: another with less was no rival then and is not asked again
MIN_RIVAL_SHARE = 0.1  # of what an effect explains: another that leaves more than that is no rival

_Key = tuple[frozenset[str], frozenset[str]]


@dataclass
class Stepwise:
    """The search over structures on one problem.

    Attributes
    ----------
    base
        The declared model, fitted.
    allowed
        Names of the effects that may be named.
    weigher
        Weighs models against each other.
    whole, samples
        The likelihood on more of the recording, and how many samples the recording has: for models that lie close.
    best
        The model that is believed so far.
    """

    problem: PredictionError
    base: Fit
    allowed: Sequence[str]
    weigher: EvidenceModel
    say: Callable[[str], None] = lambda text: None
    whole: PredictionError | None = None
    samples: int = 0
    rounds: list[Round] = field(default_factory=list)
    rivals: dict[str, dict[str, Fit]] = field(default_factory=dict)
    between_rivals: dict[str, tuple[Structure, Array]] = field(default_factory=dict)  # ``model_spread``, and of what
    dropped: list[tuple[str, str]] = field(default_factory=list)
    stood_for_curves: set[str] = field(default_factory=set)  # wrong names: a curve explains what they seemed to
    settled: frozenset[str] = frozenset()  # effects that a search on fewer samples has judged against all others
    best: Fit = None  # type: ignore[assignment]
    inflation: dict[str, float] = field(default_factory=dict)  # of every effect that was added, beside all others
    left: FreeFormFit | None = None  # a curve that belongs beside the model, though no effect of that kind is known
    in_place: Fit | None = None  # the model with a curve in the place of names that it beat
    doubtful: list[FreeFormFit] = field(default_factory=list)  # curves beside the model that are hardly chance
    _on_all: dict[_Key, Fit] = field(default_factory=dict)
    needed: dict[str, float] = field(default_factory=dict)  # support of an effect beside all others

    def __post_init__(self) -> None:
        self.best = self.base
        self.trials = TrialFits(self.problem, self.base.structure, self.allowed, self.weigher)

    def run(self) -> Stepwise:
        """Add effects as long as one is worth it; judge each again beside the others; drop what is needless."""
        add_effects(self)
        return self.concluded()

    def concluded(self) -> Stepwise:
        """The search to go on with, its best model judged again and compared with curves: this one or one without."""
        for other in (partial(with_others_in_place, self), self.re_evaluate):
            before, self.best = self.best.structure, other(self.best)
            if self.best.structure.parts != before.parts:  # beside what was replaced, others may have shown nothing
                add_effects(self)
        if late := [n for n in self.trials.added(self.best) if effects.get(n).is_late and self._judged_beside_less(n)]:
            self.best = self.re_evaluate(self.best, late)
        if why := not_as_strong(self.best, self.trials.added(self.best)):
            begin_again_without(self, why)
            return self.concluded()
        if (why := seen_too_little(self, self.best)) and (instead := gone_on_without(self, why)):
            return instead
        self.best = self.backward_elimination(self.best, [*self.best.structure.terms, *self.trials.added(self.best)])
        self.best = self.compare_with_free_form(against_curves(self, self.best))
        return self

    def apart(self, **changes: Any) -> Stepwise:
        """The same with other settings and with lists of its own: what one takes back is not taken from the other."""
        have = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{**{k: copy(v) for k, v in have.items() if isinstance(v, list | dict | set)}, **changes})

    def known(self, structure: Structure) -> Fit | None:
        """A structure as the search has fitted it, on the way or to ask what is needed; None where it has not."""
        on_the_way = [r.now for r in self.rounds if r.now.structure.parts == structure.parts]
        return on_the_way[-1] if on_the_way else self.trials.known.of(structure)

    def compare_with_free_form(self, now: Fit) -> Fit:
        """Without names that explain nothing beside a curve over what is left."""
        self.say("checking the residual for anything that no known effect explains")
        while True:
            left, self.doubtful = fit_free_forms(self, now)
            self.left = left
            name = None if left is None else redundant_given(self, left, self.trials.added(now))
            if left is None or name is None:
                break
            self.dropped.append((name, "a free-form curve explains its share as well, so it is not needed"))
            self.stood_for_curves.add(name)
            self.say(f"took {plain(name)} back: an arbitrary curve explains it as well")
            now = self.without(now, name, FULL_ITERATIONS)
        return now

    @property
    def trusted(self) -> bool:
        """Whether the likelihood is right about every effect of its model, and so about the disturbance it leaves."""
        return all(is_trusted(self.inflation.get(e, 1.0)) for e in self.trials.added(self.best))

    def score_candidates(self, now: Fit) -> tuple[list[Score], dict[str, Evidence]]:
        """All candidates' scores, and the evidence for the most promising, fitted."""
        scores, fits = self.trials.score_round(now)
        return scores, self.weigher.all(now, fits)

    def best_candidate(self, tried: Mapping[str, Evidence]) -> str | None:
        """The candidate that is best supported, or the simplest of those that are as likely; None where none counts."""
        good = {n: e for n, e in tried.items() if e.support > ADDED_SUPPORT and e.weight > WEIGHT}
        best = min(good.values(), key=lambda e: e.fit.penalised, default=None)
        if best is None:
            return None
        if drives(best.fit):  # no platform feeds its motion: what does so is a delay or a lag that is missing
            passive = {n: e for n, e in good.items() if not drives(e.fit) and e.support > best.support}
            good, best = passive or good, min(passive.values(), key=lambda e: e.fit.penalised, default=best)
        special = [n for n in effects.get(best.effect).nests if n in good and prefers_special_case(good[n], best)]
        if special:
            best = max((good[n] for n in special), key=lambda e: e.support)
        near = {n: e for n, e in good.items() if e is best or explains_most(e, best)}
        alike = [n for n, e in near.items() if support_difference(e.fit, best.fit) < STRONG_SUPPORT]
        chosen = simplest(self.weigher, {n: good[n].fit for n in alike})
        lower = [n for n in effects.get(chosen).lower_order if n in good]
        return lower[0] if lower else chosen

    def re_evaluate(self, now: Fit, names: Sequence[str] | None = None) -> Fit:
        """Every named effect, or some of them, against all others in its place, beside the finished rest."""
        for name in self.trials.added(now) if names is None else names:
            if name not in now.structure.effects or (name in self.settled and names is None):
                continue
            rest, others = self._others(now, name)
            gap = MIN_RIVAL_SHARE * (rest.cost - now.cost)
            near = [n for n, f in others.items() if f.penalised - now.penalised < gap]
            fits: dict[str, Fit] = {name: now, **others}
            fits |= zip(near, self.trials.all_further([others[n] for n in near]), strict=True)
            fits = {n: without_absorbing_stiffness(self, f) for n, f in fits.items()}
            fits = self.trials.no_worse_than_special_cases(rest, fits)
            now = min((f for f in (now, fits[name]) if f.structure == now.structure), key=lambda f: f.cost)
            seen = self.weigher.all(rest, fits)
            self.needed[name] = seen[name].support
            chosen, alike = self._best_of(name, seen)
            self.inflation[chosen] = seen[chosen].inflation
            if chosen != name:
                self.say(f"replaced {plain(name)} by {plain(chosen)}: it fits better beside the other effects")
                now = fits[chosen]
            self.rivals.pop(name, None)
            self.rivals[chosen] = {n: fits[n] for n in alike if n != chosen}
            self.between_rivals[chosen] = (now.structure, self._between(chosen, fits))
        return now

    def _judged_beside_less(self, name: str) -> bool:
        """Whether an effect was held against the others before the last one was found: then a lag had another form."""
        structure, _ = self.between_rivals.get(name, (self.base.structure, None))
        return structure.parts != self.best.structure.parts

    def without(self, now: Fit, name: str, steps: int = TRIAL_ITERATIONS) -> Fit:
        """The same without a term or an effect."""
        return self.all_without(now, [name], steps)[0]

    def all_without(self, now: Fit, names: Sequence[str], steps: int = TRIAL_ITERATIONS) -> list[Fit]:
        """The same without each of some terms or effects, side by side; what was fitted before is not fitted again."""
        fits = self.problem.workers.side_by_side([partial(self._fitted_without, now, n, steps) for n in names])
        return [self.trials.known.best(f) if np.isfinite(f.cost) else f for f in fits]

    def _fitted_without(self, now: Fit, name: str, steps: int) -> Fit:
        less = now.structure.minus(name)
        fit = self.trials.known.of(less)
        if fit is None:
            fit = self.problem.fit(less, now.without(name), now.noise, steps, carry=now.shots, thorough=False)
        return fit if fit.arrived or not np.isfinite(fit.cost) else self.trials.further(fit)

    def _others(self, now: Fit, name: str) -> tuple[Fit, dict[str, Fit]]:
        """A model without an effect, and with others in its place; from the round that added it, if that stands."""
        without = now.structure.minus(name)
        for r in reversed(self.rounds):
            if r.chosen == name and r.now.structure.parts == without.parts:
                tried = {n: e.fit for n, e in r.tried.items() if n != name}
                for special, fit in self.trials.special_cases(now, r.now, name).items():
                    if special not in tried or fit.cost < tried[special].cost:
                        tried[special] = fit
                return r.now, tried
        rest = self.without(now, name, FULL_ITERATIONS)
        return rest, self.trials.alternatives_to(now, rest, name, self._promising(name))

    def _promising(self, name: str) -> set[str]:
        """Effects whose score was not far behind what was added, in any round; of a lag or a delay, all of these."""
        out = {n for n in self.allowed if effects.get(n).is_late and effects.get(name).is_late}
        for r in self.rounds:
            own = next((s.gain for s in r.scores if s.effect == r.chosen), 0.0)
            out |= {s.effect for s in r.scores if s.gain > PROMISING * own} | set(r.tried)
        return out

    def _best_of(self, name: str, seen: Mapping[str, Evidence]) -> tuple[str, list[str]]:
        """The one that is named of an effect and others in its place, and all that are as likely."""
        best = seen[name]
        for other in seen.values():
            special = best.effect in effects.get(other.effect).nests and not self._has_more(other, best)
            if other.weight > WEIGHT and support_difference(best.fit, other.fit) > STRONG_SUPPORT and not special:
                best = other
        while held := [n for n in effects.get(best.effect).nests if n in seen and not self._has_more(best, seen[n])]:
            best = max((seen[n] for n in held), key=lambda e: e.support)
        late = {n for n in seen if effects.get(n).is_late}  # of which torque shows little
        alike = [
            n for n, e in seen.items()
            if e is best or ((e.weight > WEIGHT or {n, best.effect} <= late) and max(
                support_difference(e.fit, best.fit), support_difference(best.fit, e.fit)
            ) < STRONG_SUPPORT)
        ]  # fmt: skip
        more = max(1.0, self.samples / max(best.fit.count, 1))
        richer = {n for n in alike if best.effect in effects.get(n).nests}  # to which it was preferred
        close = [n for n in alike if n not in richer and not no_possible_gain(seen, n, alike, more)]
        if len(close) > 1 and self.whole is not None:
            fits = {n: self.on_all(seen[n].fit) for n in close}
            fits = {n: f for n, f in fits.items() if np.isfinite(f.cost)}  # a model may run away there
            if fits:
                likeliest = min(fits.values(), key=lambda f: f.penalised)
                alike = [n for n, f in fits.items() if support_difference(f, likeliest) < STRONG_SUPPORT]
        return simplest(self.weigher, {n: seen[n].fit for n in alike}), alike

    def _between(self, chosen: str, fits: Mapping[str, Fit]) -> Array:
        """By how much J, C and K differ with rivals; a richer effect and its special case are none of each other."""
        nested = {chosen, *effects.get(chosen).nests} | {n for n in fits if chosen in effects.get(n).nests}
        models = [fits[chosen], *(f for n, f in self.rivals[chosen].items() if n not in nested)]
        on_all = [f for m in models if (f := self._on_all.get(m.structure.parts)) is not None]
        return model_spread(*(on_all if len(on_all) == len(models) else models), ahead=support_difference)

    def _has_more(self, rich: Evidence, special: Evidence) -> bool:
        """Whether an effect is worth it after its special case, judged as it was when it was added."""
        more = self.weigher.evidence(rich.effect, special.fit, rich.fit)
        return more.support > ADDED_SUPPORT and more.weight > WEIGHT

    def on_all(self, fit: Fit) -> Fit:
        """The same model on all samples."""
        assert self.whole is not None
        key = fit.structure.parts
        if key not in self._on_all:
            noise = self.whole.noise_of(fit)
            self._on_all[key] = self.whole.fit(fit.structure, fit.values, noise, TRIAL_ITERATIONS, thorough=False)
        return self._on_all[key]

    def backward_elimination(self, now: Fit, names: Sequence[str]) -> Fit:
        """Without every term or effect that the data do as well without, the least needed first.

        Of two that stand for each other either is needless beside the other, and neither once the other has gone.
        """
        while len(now.structure.terms) + len(now.structure.effects) > 1:
            have = [n for n in names if n in (*now.structure.terms, *now.structure.effects)]
            seen = needless(self, now, [n for n in have if is_in_doubt(self, now, n)])
            if not seen:
                break
            least, light = min(seen, key=lambda s: s[0].support)
            why = f"the log-likelihood changes by {-0.5 * least.gain:+.2g} without it"
            by_others = light and least.effect in TERMS
            self.dropped.append((least.effect, "the other terms already explain its torque" if by_others else why))
            self.say(f"dropped {plain(least.effect)}")
            now = self.without(now, least.effect)  # fitted to ask
        return now
