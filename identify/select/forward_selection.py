"""Forward selection: effects added one at a time, two at once where neither shows alone, and one on trial.

What a model predicts wrongly while much is missing may hide how much of the torque an effect carries. One that is
proven and lets predictions err by clearly less is therefore added on trial: it stays if others are found beside it and
it carries its share by then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from identify.likelihood.fit import Fit
from identify.likelihood.normal_equations import COST_TOLERANCE
from identify.propose.innovation_score import Score
from identify.select.curve_rivals import is_beaten
from identify.select.evidence import ADDED_SUPPORT, MAX_EFFECTS, STRONG_SUPPORT, WEIGHT, Evidence
from identify.select.trial_fits import FULL_ITERATIONS
from identify.wording import joined, plain
from rig import effects

if TYPE_CHECKING:
    from identify.select.stepwise import Stepwise

MOST_PASSES = 4  # of a fit that is kept and has not arrived: its noise may begin many decades off
SERIES = 2  # effects of one kind, beside which a curve in their place is tried before a third is added


@dataclass(frozen=True)
class Round:
    """What was tried in one round: every candidate's score, the evidence of those fitted, and what was added."""

    number: int
    now: Fit
    scores: tuple[Score, ...]
    tried: Mapping[str, Evidence]
    added: tuple[str, ...]

    @property
    def chosen(self) -> str | None:
        """The effect that was added alone."""
        return self.added[0] if len(self.added) == 1 else None


def add_effects(search: Stepwise) -> None:
    """Add effects to a search's best model as long as some are worth it."""
    trial: tuple[str, Fit] | None = None  # the effect on trial, and the model without it
    search.best = _to_its_end(search, search.best)
    for number in range(len(search.settled) + len(search.rounds) + 1, MAX_EFFECTS + 1):
        now = search.best
        scores, tried = search.score_candidates(now)
        chosen = search.best_candidate(tried)
        if chosen is None:
            tried = _arrived(search, now, tried)
            chosen = search.best_candidate(tried)
        if chosen and _is_series(search, now, chosen) and is_beaten(search, now):
            break
        new = tried[chosen] if chosen else _pair(search, now, scores)
        how = _share_of_disturbance(new, bool(search.trials.added(now))) if new else "on trial"
        if new is None and trial is None and (new := _on_trial(tried)):
            trial = (new.effect, now)
        added = tuple(e for e in new.fit.structure.effects if e not in now.structure.effects) if new else ()
        search.rounds.append(Round(number, now, tuple(scores), tried, added))
        if new is None:
            break
        search.say(f"added {joined([plain(name) for name in added])}: {how}")
        best = _to_its_end(search, new.fit)
        if trial and trial[1] is now:
            search.best = best
            continue
        search.best = search.backward_elimination(best, [e for e in search.trials.added(best) if e not in added])
        if trial and _carries_its_share(search, trial[0]):
            trial = None
    if trial:
        search.say(f"took {plain(trial[0])} back")
        search.best = _without_trial(search, *trial)


def begin_again_without(search: Stepwise, why: Mapping[str, str]) -> None:
    """Take effects back for a reason each, offer none of their kinds any more, and look for others."""
    kinds = {effects.first_of(n) for n in why}
    for name, reason in why.items():
        search.dropped.append((name, reason))
        search.say(f"took {plain(name)} back: {reason}")
        search.best = search.without(search.best, name, FULL_ITERATIONS)
    search.stood_for_curves |= set(why)
    search.allowed = search.trials.allowed = [n for n in search.allowed if effects.first_of(n) not in kinds]
    add_effects(search)


def gone_on_without(search: Stepwise, why: Mapping[str, str]) -> Stepwise | None:
    """A search of its own gone on without some effects; None where these explain clearly more than what it finds."""
    other = search.apart()
    other.best, other.trials.known = search.best, search.trials.known
    begin_again_without(other, why)
    other = other.concluded()
    more = search.weigher.evidence(next(iter(why)), other.best, search.best)
    if more.support > ADDED_SUPPORT and more.weight > WEIGHT:
        search.say(
            f"kept {joined([plain(n) for n in why])}: explains {100.0 * more.weight:.0f} % of what the others leave"
        )
        return None
    return other


def _share_of_disturbance(new: Evidence, beside_others: bool) -> str:
    """How much of the disturbance an effect takes, of all of it or of what the effects before it have left."""
    return f"explains {100.0 * new.weight:.0f} % of the torque that was {'still ' if beside_others else ''}unexplained"


def _arrived(search: Stepwise, now: Fit, tried: dict[str, Evidence]) -> dict[str, Evidence]:
    """The same with candidates that are likelier but not believed followed to their minimum.

    Short of it their scores scatter because they have not arrived, and that passes for a likelihood that is wrong. One
    that is less likely than the model it contains has not arrived either.
    """
    short = [n for n, e in tried.items() if e.gain < 0.0 or e.gain - e.price > ADDED_SUPPORT > e.support]
    doubted = [n for n in short if tried[n].weight > WEIGHT]
    if not doubted:
        return tried
    ends = dict(zip(doubted, search.trials.all_further([tried[n].fit for n in doubted]), strict=True))
    moved = {n: fit for n, fit in ends.items() if fit.cost < tried[n].fit.cost - COST_TOLERANCE}
    return {**tried, **search.weigher.all(now, moved)} if moved else tried


def _to_its_end(search: Stepwise, fit: Fit) -> Fit:
    """A fit that has arrived: short of it, whatever is added next lets it go on, and passes for what was missing."""
    for _ in range(MOST_PASSES):
        if fit.arrived:
            break
        before, fit = fit, search.trials.further(fit)
        if before.cost - fit.cost < COST_TOLERANCE:
            break
    return fit


def _is_series(search: Stepwise, now: Fit, name: str) -> bool:
    """Whether an effect is the third of a kind: any curve is a sum of waves, and none of them need be there."""
    return sum(effects.first_of(e) == effects.first_of(name) for e in search.trials.added(now)) >= SERIES


def _pair(search: Stepwise, now: Fit, scores: Sequence[Score]) -> Evidence | None:
    """The likeliest two effects at once that are worth it together; None where none are."""
    seen = [search.weigher.evidence(one, now, fit) for one, fit in search.trials.pairs(now, scores)]
    good = [e for e in seen if e.support > ADDED_SUPPORT and e.weight > WEIGHT]
    return min(good, key=lambda e: e.fit.penalised, default=None)


def _on_trial(tried: Mapping[str, Evidence]) -> Evidence | None:
    """The likeliest effect that is proven, though it carries little torque as yet."""
    proven = [e for e in tried.values() if e.support > ADDED_SUPPORT and e.unfollowed_share > WEIGHT]
    return min(proven, key=lambda e: e.fit.penalised, default=None)


def _carries_its_share(search: Stepwise, name: str) -> bool:
    """Whether an effect that is still there carries its share beside all others."""
    if name not in search.best.structure.effects:
        return True
    evidence = search.weigher.evidence(name, search.without(search.best, name), search.best)
    return evidence.support > STRONG_SUPPORT and evidence.weight > WEIGHT


def _without_trial(search: Stepwise, name: str, before: Fit) -> Fit:
    """The model without an effect that carries nothing still: as it was, or with what was found since."""
    search.dropped.append((name, "the other terms already explain its torque"))
    found = len(search.best.structure.effects) > len(before.structure.effects) + 1
    return search.without(search.best, name, FULL_ITERATIONS) if found else before
