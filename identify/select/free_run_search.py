"""The search where the model can run free: scores over whole runs pick candidates, likelihood decides.

Near the data every effect, however small, shows in a free run over the whole of each set: what a short horizon
loses in start states is most of what a small effect tells. So each round scores all candidates, fits the best of
them by output error over whole runs, and takes the best one if chi square falls by more than chance and a
penalty for its parameters explain, on the samples fitted and on the held-out ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.cross_validation import Judged
from identify.model.parameters import Name
from identify.propose.score_test import Scored
from identify.results import Candidate
from identify.select.candidates import VERY_FAR, Candidates
from identify.select.criterion import AT_NOISE, RIVAL, STILL_FAR, chosen_of, simplest
from identify.select.equivalent_models import instead_of
from identify.select.fitter import OUT_OF_SIGHT
from identify.select.free_run_fit import AT_FLOOR, ENDS_NEAR, NEAR_THEN, Whole
from identify.select.merge_test import one_for_two
from identify.select.pairwise import can_follow_anything, two_at_once
from identify.select.pruning import Pruning
from identify.select.search_state import MOST_NAMED, Search
from identify.select.short_horizon_search import MOST_EFFECTS
from rig import effects

ASTRAY = 0.3  # of the signal: a free run that leaves more may be of another structure
NEAR_SIGNAL = 0.6  # of the signal that a free run may leave for this search to begin
WELL_KNOWN = 100.0  # standard errors beyond which a minimum is no false one
FARTHEST = 10_000.0  # times the noise: beyond, the sensor's noise is not what limits this record
CLOSER = 0.5  # of the mean square at the last attempt
FAR_CLOSER = 0.2  # the same where what was named since can follow anything, and brought it closer by that alone
ATTEMPTS = 2
LEAP = 0.4  # of the squares that the right effect leaves where it is the only one that is large
LEAST = 0.4  # of the squares that the best candidate takes while the noise is still far
SAME = 0.9  # of the level of an earlier attempt with the same effects: not near enough to expect more of it
NO_SWAP = 10.0  # mean square over the noise's variance that no other effect in the place of one takes away
MOST_PAIRS = 3  # that are asked again, each against its likes
PATIENCE = 3  # effects after which the end must be near
LEFT_OVER = 0.1  # of the declared model's excess over the noise that what is named may leave, where it is no chance


class FineSearch:
    """The search over whole runs of one recording.

    Parameters
    ----------
    declared
        Values of J, C, K and of the declared effects: another place to begin from.
    """

    def __init__(
        self, candidates: Candidates, say: Callable[[str], None], declared: Mapping[Name, float] | None = None
    ) -> None:
        self.on_offer, self.say, self.declared = candidates, say, declared or {}
        self.whole, self.noise = candidates.fits.whole, candidates.fits.noise
        self.pruning = Pruning(candidates.fits, say)
        self.tried_at = np.inf
        self.attempts = 0
        self.asked_for_large = False
        self.came_near: dict[str, dict[str, Whole]] = {}
        self.passed: dict[frozenset[str], float] = {}  # structures an attempt went on from, and how near they came
        self.first_tried: dict[str, Whole] = {}  # of the first round of an attempt
        self.twin: Judged | None = None  # the declared model, where its own numbers run free better than those found
        self.declared_level = np.inf  # of the model before anything is added
        self.noted_near: set[str] = set()  # whose rivals were noted over whole runs, near the noise

    def take_over(self, found: Search) -> bool:
        """Go on from the model at hand, if it runs free near the data; ``found`` is brought up to date.

        Where no library can bring the model down to the sensor's noise, whole runs magnify what is wrong with it,
        and nothing found here is kept.
        """
        begin = self._begin(found)
        if begin is not None and self.on_offer.fits.gives_up(begin):
            return False
        pliant = any(effects.get(e).resembles_much for e in found.best.structure.effects)
        if begin is not None and begin.structure.effects == found.base.structure.effects:
            self.declared_level = begin.level
        if begin is None or not self._near(begin, FAR_CLOSER if pliant else CLOSER):
            begin = self._large(found)
            if begin is None:
                return False
        self.tried_at, self.attempts, self.first_tried = begin.level, self.attempts + 1, {}
        self.on_offer.fits.horizon = found.horizon
        trial = _copy_of(found)
        through = self._rounds(trial, begin)
        for other in (self._hidden_pair, self._large_beside):
            if not through and not self.on_offer.fits.gives_up(begin):
                trial = _copy_of(found)
                started = other(trial, begin)
                through = started is not None and self._rounds(trial, started)
        if not through:
            self.say("rejected: together these effects still do not explain the data")
            return False
        found.best, found.floor, found.free_running = trial.best, trial.floor, True
        found.base = self.twin or found.base
        found.candidates, found.rivals, found.dropped = trial.candidates, trial.rivals, trial.dropped
        found.rival_models = trial.rival_models
        return True

    def _begin(self, found: Search) -> Whole | None:
        """The model at hand over whole runs; where effects were declared also from the declared numbers, once.

        A twin of the rig is right as it stands, and a short horizon may lead away from it.
        """
        structure = found.best.structure
        begin = self.whole(structure, found.best.values())
        as_declared = structure.effects and structure == found.base.structure and not self.attempts
        if not as_declared or (begin is not None and begin.level < AT_FLOOR):
            return begin
        twin = self.whole(structure, {n: self.declared.get(n, v) for n, v in found.best.values().items()})
        if twin is None or (begin is not None and begin.squares <= twin.squares):
            return begin
        self.twin = twin.judged()
        return twin

    def _large(self, found: Search) -> Whole | None:
        """Once, where the declared model runs astray: with an effect that changes all of the motion, if near."""
        if self.asked_for_large:
            return None
        self.asked_for_large = True
        large = self.on_offer.large(found.best)
        if large is None or large.level > ENDS_NEAR * STILL_FAR:
            return None
        name = large.structure.effects[-1]
        round_ = 1 + max((c.round for c in found.candidates), default=0)
        held = float(np.sqrt(large.held / max(large.held_count, 1))) * self.noise
        found.candidates.append(Candidate(name, round_, 0.0, held, "added"))
        self.say(
            f"added {name}: free-run error {large.estimate.sigma:.3g}; without it the simulation diverges from the data"
        )
        return large

    def _large_beside(self, found: Search, now: Whole) -> Whole | None:
        """The same where the model runs no better than half astray, and no effect after the other brought it near."""
        return self._large(found) if now.estimate.sigma > ASTRAY * self.on_offer.fits.moving else None

    def _near(self, model: Whole, closer: float) -> bool:
        """Whether the free run stays close enough, and by how much closer than where this was tried before."""
        if self.attempts >= ATTEMPTS and model.level > ENDS_NEAR:
            return False
        if model.level > SAME * self.passed.get(frozenset(model.structure.effects), np.inf):
            return False  # where an attempt led nowhere from
        share = ASTRAY if self.on_offer.fits.torque_free else NEAR_SIGNAL  # a decay is searched by its own rules
        close = model.estimate.sigma < share * self.on_offer.fits.moving and model.level < FARTHEST**2
        return close and model.level < closer * self.tried_at

    def _rounds(self, found: Search, now: Whole) -> bool:
        """Rounds until nothing is worth adding; whether that ended near the sensor's noise."""
        declared = found.base.structure
        most = len(declared.effects) + PATIENCE
        first = 1 + max((c.round for c in found.candidates), default=0)
        for round_ in range(first, first + MOST_EFFECTS):
            now = self.on_offer.fits.settled(self.on_offer.sharp(now))
            if len(now.structure.effects) >= most and now.level > ENDS_NEAR:
                return False  # more than that are not believed, and each round costs more than the one before
            if self.on_offer.fits.gives_up(now):
                self.say("search over whole runs ended: no candidate comes near the sensor's noise")
                return False
            chosen = self._round(found, now, round_)
            if chosen is None:
                break
            if self._astray(chosen, now):
                return False
            now = self.pruning.pruned(found, chosen, chosen.structure.effects[:-1])
            self.passed[frozenset(now.structure.effects)] = now.level
            if len(now.structure.effects) >= most and now.level > NO_SWAP:
                return False
            # A lag in the sensor looks like one in the drive until the rest is there.
            if now.level > AT_FLOOR and not self.on_offer.fits.gives_up(now):
                now = self._asked_again(found, now)
        if not self._believed(now, declared.effects):
            return False
        now = self.pruning.restored(found, now, declared.terms)
        now = self.pruning.pruned(found, now, (*now.structure.terms, *now.structure.effects))
        swapped = self._asked_again(found, now, int(self.noted_near.issuperset(now.structure.effects[-1:])))
        if swapped.structure != now.structure:  # what another one's mistakes had called for is no longer needed
            swapped = self.pruning.pruned(found, swapped, swapped.structure.effects)
        now = one_for_two(self.on_offer, found, swapped, self.say)
        for name in now.structure.effects[len(declared.effects) :]:
            if now.judged().strength(name) < WELL_KNOWN:
                now = self.on_offer.fits.elsewhere(now, name)
        found.best, found.floor = now.judged(), self.noise
        return True

    def _believed(self, now: Whole, declared: Sequence[str]) -> bool:
        """Whether what was added ends near the noise, and leaves little of what it was to explain.

        What is in no library is resembled by something that is: three effects took four fifths of a gain that warms.
        What can follow anything has to bring the model all the way: with creep and cogging a spring that relaxes twice
        came to 1.2.
        """
        added = len(now.structure.effects) - len(declared)
        if now.level > ENDS_NEAR or added > MOST_NAMED:
            return False
        if any(effects.get(e).resembles_much for e in now.structure.effects[len(declared) :]):
            return now.level < AT_FLOOR
        little = now.level - 1.0 < LEFT_OVER * (self.declared_level - 1.0)
        return added <= 0 or now.level < AT_FLOOR or little

    def _hidden_pair(self, found: Search, now: Whole) -> Whole | None:
        """With two effects that no search for one at a time finds, where both bring the model near the data."""
        if len(now.structure.effects) + 2 > len(found.base.structure.effects) + MOST_NAMED:
            return None
        pairs = two_at_once(self.on_offer, now, self.first_tried)
        asked = (self._asked_again(found, pair, 0) for pair in pairs[:MOST_PAIRS])
        best = next((w for w in asked if w.level < AT_NOISE or not can_follow_anything(w)), None)
        if best is None:
            return None
        for gone in [n for n in found.rivals if n not in best.structure.effects]:  # of pairs that were refused
            del found.rivals[gone]
            found.rival_models.pop(gone, None)
        new = sorted(best.structure.effects[-2:], key=best.judged().strength, reverse=True)
        round_ = 1 + max((c.round for c in found.candidates), default=0)
        held = float(np.sqrt(best.held / max(best.held_count, 1))) * self.noise
        for name in new:
            found.candidates.append(Candidate(name, round_, best.penalised - now.penalised, held, "added"))
        self.say(
            f"added {' and '.join(new)} at once: free-run error {now.estimate.sigma:.3g} -> {best.estimate.sigma:.3g}"
        )
        ordered = replace(best.structure, effects=(*best.structure.effects[:-2], *new))
        return self.whole(ordered, best.values())

    @staticmethod
    def _astray(new: Whole, now: Whole) -> bool:
        """Whether a round brought too little for whole runs to be the right place to look: a short horizon is."""
        left = new.squares / max(now.squares, 1e-300)
        return (new.level > STILL_FAR and left > 1.0 - LEAST) or (new.level > VERY_FAR and left > LEAP)

    def _asked_again(self, found: Search, now: Whole, newest: int = 1) -> Whole:
        """Effects that were added while others were still missing, each against those that came near it then.

        The ``newest`` of them were chosen beside all the others and are not asked.
        """
        added = list(now.structure.effects[len(found.base.structure.effects) :])
        waiting = added[: len(added) - newest]
        while waiting:
            name = waiting.pop(0)
            tried = {name: now}
            near = self.came_near.get(name, {})
            for other, own in instead_of(now, name, near, self.on_offer.allowed).items():
                if other in now.structure.effects or name in effects.get(other).nests:
                    continue  # what contains the named one was asked in the last round, on top of it
                start = {n: v for n, v in now.values().items() if n[0] != name} | own
                names = tuple(other if e == name else e for e in now.structure.effects)
                fit = self.on_offer.fits.by_way_of_a_short_horizon if now.level > STILL_FAR else self.whole
                swapped = fit(replace(now.structure, effects=names), start, OUT_OF_SIGHT * now.estimate.sigma)
                if swapped is not None:
                    tried[other] = swapped
            chosen = simplest(tried)
            if chosen != name and added[-1:] and added[-1] in now.structure.effects:
                waiting += [n for n in added[-1:] if n != name and n not in waiting]  # chosen beside the one that goes
                added.pop()
            if chosen != name:
                self.say(f"replaced {name} by {chosen}: it fits better beside the other effects")
            now = tried[chosen]
            found.rivals.pop(name, None)
            found.rival_models.pop(name, None)
            self._note_rivals(found, chosen, tried)
        return now

    def _round(self, found: Search, now: Whole, round_: int) -> Whole | None:
        tried, looks = self.on_offer.tried(now)
        self.first_tried = self.first_tried or tried
        name = chosen_of(tried, now)
        self._keep_books(found, now, tried, looks, name, round_)
        if name is None:
            return None
        best = tried[name]
        self.came_near[name] = {
            n: w for n, w in tried.items()
            if n != name and (w.squares < NEAR_THEN * best.squares or n in effects.get(name).nests)
        }  # fmt: skip
        best = self.on_offer.fits.anew(best)
        if best.at_noise and best.judged().strength(name) < WELL_KNOWN:  # above it that was asked when it was tried
            best = self.on_offer.fits.elsewhere(best, name)
        self.say(f"added {name}: free-run error {now.estimate.sigma:.3g} -> {best.estimate.sigma:.3g}")
        return best

    def _note_rivals(self, found: Search, name: str, tried: Mapping[str, Whole]) -> None:
        """Who did as well as the one named, and with which model."""
        best = tried[name]
        (self.noted_near.add if best.level < ENDS_NEAR else self.noted_near.discard)(name)
        alike = {
            n: w.estimate.platform()
            for n, w in tried.items() if n != name and w.behind(best) < RIVAL * best.level
        }  # fmt: skip
        found.rivals[name], found.rival_models[name] = tuple(alike), alike

    def _keep_books(
        self, found: Search, now: Whole, tried: Mapping[str, Whole], looks: Sequence[Scored], name: str | None,
        round_: int,
    ) -> None:  # fmt: skip
        """Every candidate of the round with its figures; rivals of the one added."""
        if name is not None:
            self._note_rivals(found, name, tried)
        for other, w in tried.items():
            if other == name:
                status = "added"
            elif name is None:
                status = "not worth it"
            else:
                status = "rival" if other in found.rivals[name] else "no better"
            held = float(np.sqrt(w.held / max(w.held_count, 1))) * self.noise
            found.candidates.append(Candidate(other, round_, w.penalised - now.penalised, held, status))
        for s in looks:
            if s.effect not in tried:
                penalty = s.count * float(np.log(max(now.count, 2)))
                found.candidates.append(Candidate(s.effect, round_, penalty - s.gain, None, "screened out"))


def _copy_of(found: Search) -> Search:
    """Of which nothing reaches the original."""
    return replace(
        found, candidates=list(found.candidates), rivals=dict(found.rivals), dropped=list(found.dropped),
        rival_models=dict(found.rival_models),
    )  # fmt: skip
