"""Which effects carry the torque that the declared model leaves: a stepwise search in torque, in the band that matters.

A name takes weight and evidence. Weight is the share of the held-out residual's power, the sensor's part taken off,
that an effect takes away; evidence is that the squared residual falls all over the held-out samples, block by block. Of
candidates that carry nearly as much the simplest is taken, of these the likeliest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.propose.torque_looks import candidate_torques
from identify.results import TAKEN_BACK, Candidate
from identify.runs.observability import one_more
from identify.select.evidence import MAX_EFFECTS, STRONG_SUPPORT, WEIGHT
from identify.select.search_state import Search
from identify.wording import plain
from rig import effects
from rig.effects.base import Place

FALL_SIGMAS = 4.0  # standard errors, over blocks of the held-out samples, by which the squared residual must fall: 3e-5
SEARCHED_FALL_SIGMAS = 5.4  # the same by chance for the best of a thousand shapes
RICHER = 0.6  # share of what its special case leaves that a richer effect has to take away to be named in its place
EQUAL_WEIGHT_MARGIN = 0.05  # of what is left: candidates that differ by less carry the same torque
RIVAL = 0.02  # of what is left: rivals carry as much as what was taken, to that
INERTIA_MATTERS = 0.2  # of the torque: below, the motion hardly shows the inertia
WORTH_EVIDENCE = 0.2  # of the weight that names: less is not worth working out how sure it is
REFINED = 8  # candidates whose shapes are searched for beside those of a grid


@dataclass(frozen=True)
class TorqueCandidate:
    """One candidate on top of a model.

    Attributes
    ----------
    weight
        Share of the held-out residual's power, the sensor's part taken off, that it takes away.
    evidence
        Fall of the penalised cost with a coloured residual.
    fall_sigmas
        Standard errors by which the squared residual falls, over blocks of the held-out samples: of the falls, or of
        their logarithms, whichever is more.
    absolute_fall_sigmas
        Of the falls alone: what a few moments decide has little of it.
    """

    effect: str
    fit: TorqueFit
    weight: float
    evidence: float
    fall_sigmas: float
    absolute_fall_sigmas: float

    @property
    def is_significant(self) -> bool:
        """Whether it is proven and carries enough to be named."""
        if self.weight < WEIGHT:
            return False
        # The shape of a flexible one was looked for on the held-out samples, too.
        looked_for = effects.get(self.effect).is_flexible and self.absolute_fall_sigmas < FALL_SIGMAS
        return self.fall_sigmas >= (SEARCHED_FALL_SIGMAS if looked_for else FALL_SIGMAS)


@dataclass
class TorqueSearch:
    """The search and what it found.

    Attributes
    ----------
    regression
        Fits in torque over the runs that are searched.
    floor_nm
        What the sensor's noise alone leaves in the residual, root mean square.
    acceleration
        Root mean square of the motion's acceleration, rad/s^2.
    allowed
        Names of the effects that may be named.
    """

    regression: TorqueRegression
    base: TorqueFit
    floor_nm: float
    acceleration: float
    allowed: Sequence[str]
    say: Callable[[str], None] = lambda text: None
    rounds: list[tuple[TorqueCandidate, ...]] = field(default_factory=list)
    path: list[TorqueFit] = field(default_factory=list)  # models on the way, the last one the result

    def run(self, begin: TorqueFit | None = None) -> TorqueFit:
        """Add effects as long as one carries weight, drop what no longer does, and judge again what was added early.

        What falls back to a model that was there before would go round for ever: it ends with that.
        ``begin`` is where to begin; at the declared model where None.
        """
        now = self.without_absorbing_stiffness(begin or self.base)
        before = {now.structure.parts}
        while True:
            chosen = self._next(now) or self._in_place(now)
            if chosen is None:
                break
            share = f"{100.0 * chosen.weight:.0f} % of the residual torque on held-out data"
            self.say(f"added {plain(chosen.effect)}: explains {share}")
            now = self.backward_elimination(self.without_absorbing_stiffness(chosen.fit))
            if now.structure.parts in before:
                break
            before.add(now.structure.parts)
            self.path.append(now)
        return now

    def _next(self, now: TorqueFit) -> TorqueCandidate | None:
        """The effect to add."""
        if len(now.structure.effects) >= MAX_EFFECTS + len(self.base.structure.effects):
            return None
        looks = self.candidates(now)
        self.rounds.append(tuple(looks))
        return self.best_candidate(looks)

    def _in_place(self, now: TorqueFit) -> TorqueCandidate | None:
        """An effect that carries more in the place of one that follows almost anything; its model is without that.

        What was added early was asked while the others were still missing, and may have followed part of theirs: in
        steady turning a tone stands for a wave over the angle. One with more parameters follows more freely, as a tone
        does, which has a phase in every run: that it carries more there is no wonder.
        """
        found = [e for e in now.structure.effects if e not in self.base.structure.effects]
        for name in found[:-1]:
            if not effects.get(name).is_flexible or any(name in effects.get(e).lower_order for e in found):
                continue
            without = self.without(now, name)
            size = len(now.values)
            looks = [w for w in self.candidates(without) if w.effect != name and len(w.fit.values) <= size]
            chosen = self.best_candidate([self.candidate(name, without, now), *looks])
            if chosen is not None and chosen.effect != name:
                self.say(f"{plain(name)} is replaced: another effect carries its torque beside the others")
                self.rounds.append(tuple(looks))
                return chosen
        return None

    def left(self, fit: TorqueFit) -> float:
        """Held-out power of the residual above the sensor's."""
        return fit.power_above(self.floor_nm)

    def candidate(self, name: str, now: TorqueFit, fit: TorqueFit) -> TorqueCandidate:
        """A candidate's weight and evidence on top of a model."""
        share = 1.0 - self._smaller_inertia(now, fit) * self.left(fit) / self.left(now)
        worth = share > WORTH_EVIDENCE * WEIGHT
        evidence = self.regression.evidence(now, fit) if worth else 0.0
        by_size, by_ratio = self.regression.fall_in_sigmas(now, fit) if worth else (0.0, 0.0)
        # A wave that fits one run all along need not come back in another: there the largest moments speak alone.
        of_one_run = effects.get(name).is_flexible and not self.regression.judges_by_other_runs
        return TorqueCandidate(name, fit, share, evidence, by_size if of_one_run else max(by_size, by_ratio), by_size)

    def _smaller_inertia(self, now: TorqueFit, fit: TorqueFit) -> float:
        """By how much more a smaller inertia makes of the same torque, in acceleration and squared.

        Where inertia takes a good part of the torque it is the motion that has to be explained: with no inertia left,
        and a friction that feeds on the torque, any torque explains itself.
        """
        old, new = (f.values.get(("inertia",), 0.0) for f in (now, fit))
        if old * self.acceleration < INERTIA_MATTERS * self.regression.torque_nm or new >= old:
            return 1.0
        return float((old / max(new, 1e-9 * old)) ** 2)

    def candidates(self, now: TorqueFit) -> list[TorqueCandidate]:
        """All candidates on top of a model, the heaviest first."""
        spring = "stiffness" in now.structure.terms
        answers = now.values.get(("inertia",), 0.0) * self.acceleration > INERTIA_MATTERS * self.regression.torque_nm
        have = now.structure.effects
        more = [m for m in one_more(have, now.values, self.regression.traces) if effects.first_of(m) in self.allowed]
        names = [
            n for n in (*(a for a in self.allowed if a not in have), *more)
            if (spring or effects.get(n).family != "restoring torque")
            and (answers or effects.get(n).place is not Place.DRIVE)  # a late torque shows in what it sets in motion
            and not set(effects.get(n).nests) & set(have)  # what holds one that is there is asked in its place
        ]  # fmt: skip
        looks = candidate_torques(self.regression, now, names, REFINED)
        return sorted((self.candidate(w.effect, now, w.fit) for w in looks), key=lambda w: -w.weight)

    @staticmethod
    def best_candidate(looks: Sequence[TorqueCandidate]) -> TorqueCandidate | None:
        """The candidate to add: of the heaviest the likeliest, of these the simplest."""
        good = [w for w in looks if w.is_significant]
        if not good:
            return None
        heaviest = max(good, key=lambda w: w.weight)
        near = [w for w in good if w.weight > heaviest.weight - EQUAL_WEIGHT_MARGIN]
        near += [w for w in good if w.effect in effects.get(heaviest.effect).nests and _holds(w, heaviest)]
        chosen = min(near, key=lambda w: (len(w.fit.values), -w.evidence))
        lower = [w for w in good if w.effect in effects.get(chosen.effect).lower_order]  # a constant before a slope
        return lower[0] if lower else chosen

    def without(self, now: TorqueFit, name: str) -> TorqueFit:
        """The same without an effect."""
        shapes = {k: v for k, v in now.shapes.items() if k != name}
        return self.regression.solve(now.structure.minus(name), shapes)

    def without_absorbing_stiffness(self, now: TorqueFit) -> TorqueFit:
        """The same without a stiffness that carries no torque of its own, or that pushes where a spring pulls."""
        if "stiffness" not in now.structure.terms:
            return now
        without = self.regression.solve(now.structure.minus("stiffness"), now.shapes)
        share = 1.0 - self.left(now) / self.left(without)
        by_size, by_ratio = self.regression.fall_in_sigmas(without, now)
        pulls = now.values[("stiffness",)] > 0.0
        return now if pulls and share >= WEIGHT and max(by_size, by_ratio) >= FALL_SIGMAS else without

    @staticmethod
    def as_good(look: TorqueCandidate, chosen: TorqueCandidate) -> bool:
        """Whether a candidate carried as much as the one that was taken and is as likely: the data do not decide."""
        as_heavy = look.is_significant and look.weight > chosen.weight - RIVAL
        return as_heavy and look.evidence > chosen.evidence - STRONG_SUPPORT

    def backward_elimination(self, now: TorqueFit) -> TorqueFit:
        """The same without the effects that no longer carry anything beside the others."""
        for name in now.structure.effects:
            if name in self.base.structure.effects or any(
                name in effects.get(e).lower_order for e in now.structure.effects
            ):
                continue
            without = self.without(now, name)
            if not self.candidate(name, without, now).is_significant:
                self.say(f"dropped {plain(name)}: the others explain its torque as well")
                return self.backward_elimination(without)
        return now

    def with_others(
        self, now: TorqueFit, gone: Sequence[str] = (), on: str = ""
    ) -> tuple[TorqueFit, list[Candidate]]:  # fmt: skip
        """The same with what else carries weight but does not follow almost anything, and what that is.

        What goes with ``on``, the quantity that the rest depends on, is asked even so. What is there already stays:
        unchanged where something of it would be dropped for the others. What is ``gone`` was taken back before, and is
        not asked.
        """
        before = {effects.first_of(name) for name in gone}
        bound = [
            n for n in self.allowed
            if effects.first_of(n) not in before and (not effects.get(n).is_flexible or on in effects.get(n).goes_with)
        ]  # fmt: skip
        further = replace(self, allowed=bound, rounds=[], path=[])
        found = further.run(now)
        new = [e for e in found.structure.effects if e not in now.structure.effects]
        if not new or not set(now.structure.effects) <= set(found.structure.effects):
            return now, []
        return found, [c for c in further.as_search(found).candidates if c.effect in new and c.status == "added"]

    def as_search(self, best: TorqueFit) -> Search:
        """What was looked at, as the report tells it."""
        structure = self.base.structure
        found = Search(self.base, best, 0.0, self.floor_nm)
        named = [e for e in best.structure.effects if e not in structure.effects]
        for number, looks in enumerate(self.rounds, 1):
            chosen = self.best_candidate(looks)
            for look in looks:
                status = _status(look, chosen, named)
                found.candidates.append(Candidate(look.effect, number, -look.evidence, None, status))
            if chosen is not None and chosen.effect in named:
                rivals = [w.effect for w in looks if w is not chosen and self.as_good(w, chosen)]
                if others := tuple(r for r in rivals if r not in named):
                    found.rivals[chosen.effect] = others
        for term in structure.terms:
            if term not in best.structure.terms:
                found.dropped.append((term, "on held-out samples the other terms already explain its torque"))
        for name in named:
            found.contribution[name] = self.without(best, name).held_nm / max(best.held_nm, 1e-300)
        return found


def _holds(simple: TorqueCandidate, rich: TorqueCandidate) -> bool:
    """Whether the richer effect carries too little beside its special case to be named in its place."""
    return (1.0 - rich.weight) > (1.0 - RICHER) * (1.0 - simple.weight)


def _status(look: TorqueCandidate, chosen: TorqueCandidate | None, named: Sequence[str]) -> str:
    if chosen is not None and look.effect == chosen.effect:
        return "added" if look.effect in named else TAKEN_BACK
    if look.is_significant:
        return "carries less than what was added"
    if look.fall_sigmas >= FALL_SIGMAS and look.weight > 0.0:
        return f"proven but small: {100.0 * look.weight:.0f} % of what is left"
    return "no better"
