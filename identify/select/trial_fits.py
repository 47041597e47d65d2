"""The candidates of a round, fitted on top of a model or in the place of another effect: which, and from where.

Which of them are fitted only costs time; what is believed of them is decided elsewhere (``stepwise``, ``evidence``).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from identify.likelihood.fit import Fit, KnownFits
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores, Score
from identify.propose.motion_scale import scale_at
from identify.propose.starts import OTHER_START, about_a_sample, as_special_case, gain_of, is_small
from identify.propose.torque_looks import CandidateTorque, candidate_torques
from identify.runs.measured_channels import simplicity
from identify.runs.observability import one_more, runs_last_for
from identify.select.evidence import PREDICTS_TO_NOISE, WEIGHT, EvidenceModel
from rig import effects
from rig.effects.base import Place, Scale

MIN_TRIAL_SCORE = 20.0  # of a score, parameters paid for: less would not be added when fitted
TRIED = 4  # candidates of a round, by their scores, that are fitted
MAX_PAIRS_FITTED = 2  # pairs of a round, by their scores, that are fitted
HEAVIEST = 3  # candidates by their weight in torque that are fitted beside those
FAINT_SCORE = 0.02  # of the best score: what promises so little is not what the round is about
TRIAL_ITERATIONS, FULL_ITERATIONS = 14, 25  # steps of a fit that is compared, and of one that is kept
FULL_FIT_RATIO = 0.9  # of the best fall of the cost in a round: such a fit is taken to its end before it is judged
BEHIND = 0.3  # of the best fall of the cost so far: what has less after a few steps is not followed
COMPARABLE = 0.3  # of the score of an effect, that another or a curve has in its place: with less no rival
FOLLOWS_LESS = 0.5  # of the excess beside which lags were tried: only then may one show that did not before


@dataclass
class TrialFits:
    """Fits of candidates.

    Attributes
    ----------
    problem
        The runs, and how they are predicted.
    declared
        The declared structure.
    allowed
        Names of the effects that may be named.
    weigher
        What models leave in torque.
    """

    problem: PredictionError
    declared: Structure
    allowed: Sequence[str]
    weigher: EvidenceModel
    known: KnownFits = field(default_factory=KnownFits)
    _excess_with_lags: float = np.inf  # reduced chi-square above one, beside which lags were tried last

    def added(self, now: Fit) -> list[str]:
        """Effects that the declared model lacks."""
        return [e for e in now.structure.effects if e not in self.declared.effects]

    def scale(self, fit: Fit) -> Scale:
        """How large the motion is, and the lines in what a model predicts wrongly."""
        return scale_at(self.problem, fit)

    def names(self, now: Fit) -> list[str]:
        """What may be added, or put in the place of a special case; of an effect that is there, one more of it."""
        have = now.structure.effects
        more = one_more(have, now.values, self.problem.traces)
        return [n for n in (*self.allowed, *more) if n not in have]

    def score_round(self, now: Fit, asked: float = 0.0) -> tuple[list[Score], dict[str, Fit]]:
        """All candidates' scores on top of a model, and fits of the most promising.

        Of a candidate a fall of the cost may be ``asked``; one with a small part of that is not followed.
        """
        names = self.names(now)
        looks = InnovationScores(self.problem, now, self.scale(now)).all(names)
        starts: dict[str, list[Mapping[Name, float] | CandidateTorque]] = {
            v[0].effect: [v[0].start] for v in self.shortlist(now, looks) if v[0].gain >= COMPARABLE * asked
        }
        for name in self.unseen(now, names):
            starts.setdefault(name, []).append(about_a_sample(name, self.scale(now), self.problem.step_s))
        for look in self.largest_torques(now, names):
            starts.setdefault(look.effect, []).append(look)
        fits = self.each_fitted(now, starts, now.cost - BEHIND * asked if asked > 0.0 else np.inf)
        most = max((now.cost - f.cost for f in fits.values()), default=0.0)
        near = [n for n, f in fits.items() if now.cost - f.cost > FULL_FIT_RATIO * most]
        # A special case that is as good is taken in the place of what contains it.
        near = [n for n in near if not set(effects.get(n).nests) & set(near)]
        fits |= zip(near, self.all_further([fits[n] for n in near]), strict=True)
        return [v[0] for v in looks], self.no_worse_than_special_cases(now, fits)

    def pairs(self, now: Fit, singles: Sequence[Score]) -> list[tuple[str, Fit]]:
        """Two effects at once where one alone shows little, fitted: those with the largest gains."""
        torque = [s for s in singles if effects.get(s.effect).place is not Place.SENSOR and not simplicity(s.effect)]
        price = float(np.log(max(now.count, 2)))
        worth = [
            (one, other) for one, other, gain in InnovationScores(self.problem, now, self.scale(now)).pairs(torque)
            if gain > MIN_TRIAL_SCORE + price * sum(len(effects.get(s.effect).parameters) for s in (one, other))
        ][:MAX_PAIRS_FITTED]  # fmt: skip

        def fitted(one: Score, other: Score) -> Fit:
            both = self.problem.fit(
                now.structure.plus(one.effect, other.effect), {**now.values, **one.start, **other.start}, now.noise,
                FULL_ITERATIONS, carry=now.shots, thorough=False, against=now.cost,
            )  # fmt: skip
            return self._in_likelier_order(both, now)

        fits = self.problem.workers.side_by_side([partial(fitted, *pair) for pair in worth])
        return [(one.effect, fit) for (one, _), fit in zip(worth, fits, strict=True)]

    def unseen(self, now: Fit, names: Sequence[str]) -> list[str]:
        """Lags of the gyro, of a model without one: where a large disturbance follows every reading, their scores are
        small however long they are, and no torque goes with them. Once they were tried, they are again where much less
        follows the readings.
        """
        excess = now.reduced_chi_square - 1.0
        if excess < PREDICTS_TO_NOISE - 1.0 or excess > FOLLOWS_LESS * self._excess_with_lags:
            return []
        lags = [n for n in (*now.structure.effects, *names) if effects.get(n).lag is not None]
        if set(lags) & set(now.structure.effects):
            return []
        self._excess_with_lags = excess
        return lags

    def each_fitted(
        self, now: Fit, starts: Mapping[str, Sequence[Mapping[Name, float] | CandidateTorque]], least: float = np.inf
    ) -> dict[str, Fit]:
        """Candidates fitted, the first two and then the others; one that begins far behind the best is not followed."""
        fits: dict[str, Fit] = {}
        workers = self.problem.workers
        tasks = list(starts.items())
        # What has a motion of its own may have to be followed in short steps, and takes longest: it begins first.
        others = sorted(tasks[workers.AT_ONCE :], key=lambda task: effects.get(task[0]).fastest_rad_s is None)
        for some in (tasks[: workers.AT_ONCE], others):
            found = workers.side_by_side([partial(self.fitted, now, name, begin, least) for name, begin in some])
            for (name, _), fit in zip(some, found, strict=True):
                if fit is not None:
                    fits[name] = self.known.best(fit)
                    least = min(least, now.cost - BEHIND * (now.cost - fits[name].cost))
        return fits

    def largest_torques(self, now: Fit, names: Sequence[str]) -> list[CandidateTorque]:
        """Candidates that carry much of the disturbance along the measured motion; none of what is the sensor's."""
        if self.weigher.is_the_sensors(now):
            return []
        there = self.weigher.in_torque(now)
        left = self.weigher.left(there)
        nested = {s for e in now.structure.effects for s in effects.get(e).nests}
        have = set(there.structure.effects)
        held = [n for n in names if n not in nested | have and not set(effects.get(n).nests) & have]
        looks = candidate_torques(self.weigher.regression, there, held, HEAVIEST)
        special = {s for w in looks for s in effects.get(w.effect).nests} - {w.effect for w in looks}
        looks += candidate_torques(self.weigher.regression, there, [n for n in held if n in special], len(special))
        floor = self.weigher.floor_nm**2
        return [w for w in looks if 1.0 - max(w.left_nm**2 - floor, 0.0) / left > WEIGHT]

    def shortlist(self, now: Fit, looks: Sequence[list[Score]]) -> list[list[Score]]:
        """The largest gains beyond their penalty, with their special cases and what comes first by order."""
        price = float(np.log(max(now.count, 2)))
        worth = [v for v in looks if v[0].gain > MIN_TRIAL_SCORE + price * len(effects.get(v[0].effect).parameters)]
        if not worth:
            return []
        plain = [v for v in worth if not simplicity(v[0].effect)]
        short = plain[:TRIED] + [v for v in worth if simplicity(v[0].effect)][:2]
        short = [v for v in short if v[0].gain > FAINT_SCORE * worth[0][0].gain]
        wanted = {n for v in short for n in (*effects.get(v[0].effect).nests, *effects.get(v[0].effect).lower_order)}
        return short + [v for v in worth if v[0].effect in wanted and v not in short]

    def fitted(
        self, now: Fit, name: str, starts: Sequence[Mapping[Name, float] | CandidateTorque], least: float = np.inf
    ) -> Fit | None:  # fmt: skip
        """A candidate fitted on top of a model, in the place of what it contains: the best from all starts."""
        effect = effects.get(name)
        held = [e for e in self.added(now) if e in effect.nests]
        structure, rest = now.structure, {k: v for k, v in now.values.items() if k[0] not in held}
        linear = {p.name for p in effect.parameters if p.linear}
        for special in held:
            structure = structure.minus(special)
        fits: list[Fit] = []

        def begun_where_it_stands(own: Mapping[Name, float]) -> Fit:
            return self.problem.fit(
                structure.plus(name), {**rest, **own}, now.noise, TRIAL_ITERATIONS, carry=now.shots, thorough=False,
                against=now.cost, least=least,
            )  # fmt: skip

        for start in starts:
            if isinstance(start, CandidateTorque):  # the rest begins there, too, and the disturbance is looked for anew
                begun = starts[0] if fits and not isinstance(starts[0], CandidateTorque) else {}
                if not fits or self._leaves_more(fits[0], start) or is_small(name, begun, start):
                    begin = {**rest, **start.start}
                    begun_there = self.problem.fit(
                        structure.plus(name), begin, None, TRIAL_ITERATIONS,
                        thorough=False, against=now.cost, least=least,
                    )  # fmt: skip
                    fits.append(begun_there)
                continue
            own = {k: v for k, v in start.items() if k[0] not in held}
            for special in held:
                own = {k: v + gain_of(now, special) if k[0] == name and k[1] in linear else v for k, v in own.items()}
            fits.append(begun_where_it_stands(own))
        best = min(fits, key=lambda f: f.cost)
        if not held and not best.cost < now.cost:  # a model is no worse than what it contains: from there, then
            own = {k: v for k, v in best.values.items() if k[0] == name and k[1] not in linear}
            fits.append(begun_where_it_stands(own))
            best = min(fits, key=lambda f: f.cost)
        best = self._in_likelier_order(best, now)
        shown = runs_last_for(name, best.values, self.problem.traces)
        return best if np.isfinite(best.cost) and shown else None

    def _in_likelier_order(self, fit: Fit, now: Fit) -> Fit:
        """The same, or with its last effect ahead of the drive's others, where that fits better.

        What the wrong order makes of J, C and K is no place to begin.
        """
        other = fit.structure.other_order()
        if other is None:
            return fit
        begin = {k: now.values.get(k, v) for k, v in fit.values.items()}
        there = self.problem.fit(
            other, begin, now.noise, TRIAL_ITERATIONS, carry=now.shots, thorough=False, against=now.cost
        )  # fmt: skip
        return there if there.cost < fit.cost else fit

    def _leaves_more(self, fit: Fit, start: CandidateTorque) -> bool:
        """Whether a fit has missed what the same effect takes in torque."""
        left = self.weigher.left(self.weigher.in_torque(fit))
        return left > OTHER_START * self.weigher.left(start.fit)

    def no_worse_than_special_cases(self, now: Fit, fits: Mapping[str, Fit]) -> dict[str, Fit]:
        """Fits of candidates on top of a model; one that came out worse than its special case begins again there."""
        out = dict(fits)
        for name in sorted(fits, key=lambda n: len(effects.get(n).nests)):
            for special in effects.get(name).nests:
                if special not in out or not out[special].cost < out[name].cost:
                    continue
                values, there = as_special_case(name, out[name], special, out[special]), out[special]
                if values is None:
                    continue
                again = self.problem.fit(
                    out[name].structure, values, there.noise, FULL_ITERATIONS, carry=there.shots, thorough=False,
                    against=now.cost,
                )  # fmt: skip
                out[name] = again if again.cost < out[name].cost else out[name]
        return out

    def further(self, fit: Fit) -> Fit:
        """The same with more steps."""
        more = self.problem.fit(fit.structure, fit.values, fit.noise, FULL_ITERATIONS, carry=fit.shots)
        return more if more.cost < fit.cost else fit

    def all_further(self, fits: Sequence[Fit]) -> list[Fit]:
        """Several fits with more steps, side by side."""
        found = self.problem.workers.side_by_side([partial(self.further, fit) for fit in fits])
        return [self.known.best(fit) for fit in found]

    def special_cases(self, now: Fit, rest: Fit, name: str) -> dict[str, Fit]:
        """Fits with a special case of an effect in its place, from where the richer one stands.

        Alone its score may point anywhere.
        """
        fits: dict[str, Fit] = {}
        rest_values = {n: v for n, v in now.values.items() if n[0] != name}
        for other in effects.get(name).nests:
            parameters = effects.get(other).parameters
            if other not in self.names(now) or not all(p.linear and not p.per_run for p in parameters):
                continue
            structure = replace(now.structure, effects=tuple(other if e == name else e for e in now.structure.effects))
            own: dict[Name, float] = {(other, p.name): gain_of(now, name) for p in parameters}
            fits[other] = self.problem.fit(
                structure, {**rest_values, **own}, now.noise, TRIAL_ITERATIONS,
                carry=now.shots, thorough=False, against=rest.cost,
            )  # fmt: skip
        return fits

    def alternatives_to(self, now: Fit, rest: Fit, name: str, among: Collection[str]) -> dict[str, Fit]:
        """Fits with another effect, of ``among``, in the place of one."""
        names = [n for n in self.names(rest) if n in among or n == name]
        looks = InnovationScores(self.problem, rest, self.scale(rest)).all(names)
        fits = self.special_cases(now, rest, name)
        own_score = next((v[0].gain for v in looks if v[0].effect == name), 0.0)
        least = rest.cost - BEHIND * (rest.cost - now.cost)
        near = [v[0] for v in self.shortlist(rest, looks) if v[0].effect != name and v[0].gain > COMPARABLE * own_score]
        fitted = self.problem.workers.side_by_side(
            [partial(self.fitted, rest, s.effect, [s.start], least) for s in near]
        )
        for score, found in zip(near, fitted, strict=True):
            other = score.effect
            if found is not None and (other not in fits or found.cost < fits[other].cost):
                fits[other] = found
        return {n: f for n, f in fits.items() if np.isfinite(f.cost)}
