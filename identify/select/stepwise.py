"""The search: effects added one at a time to a model fitted by prediction error, each judged again beside the others.

Every model has its own disturbance. While an effect is missing its torque counts as disturbance and the prediction
leans on the measurements; as effects are found the disturbance shrinks, down to the sensor's noise where all is found.
So one likelihood judges all models, of simulated rigs and of real ones, from the first that lacks everything to the
last. What it says is scaled by how far it can be believed, and a name takes weight besides (``evidence``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identify.estimate.fit import Fit
from identify.estimate.initial_guess import scale_of
from identify.estimate.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.propose.innovation_score import InnovationScores, Score
from identify.propose.torque_looks import TorqueLook, torque_looks
from identify.runs.measured_channels import simplicity
from identify.select.evidence import TRUSTED, Evidence, Weigher, disturbed
from identify.signals.spectral_lines import foreign_lines_hz, ringing_hz, rings_hz
from rig import effects
from rig.effects.base import Scale
from rig.platform import TERMS

# What decides a name. All in units of the cost (minus twice the log-likelihood) or as shares.
HOPE = 20.0  # support that no chance among all candidates and shapes makes
APART = 10.0  # support that parts two models (Kass and Raftery 1995: very strong)
WEIGHT = 0.20  # share of the disturbance that an effect takes away to be named: below, it is true but small
AS_HEAVY = 0.05  # of the disturbance: a special case that carries as much, to that, is preferred to the richer effect
SPECIAL = 0.5  # of the support of a richer effect, with which its special case is preferred
AT_NOISE = 1.1  # times the sensor's variance: a model that predicts as closely leaves no disturbance
MOST = 6  # effects that one recording is believed to show
# What only costs time.
TRIED = 4  # candidates of a round, by their scores, that are fitted
HEAVIEST = 3  # candidates by their weight in torque that are fitted beside those
FAINT = 0.02  # of the best score: what promises so little is not what the round is about
FEW, MANY = 14, 25  # steps of a fit that is compared, and of one that is kept
CERTAIN = 30.0  # standard errors beyond which nobody asks whether a term is needed
NEAR = 0.9  # of the best fall of the cost in a round: such a fit is taken to its end before it is judged
FAR_BEHIND = 0.2  # of what an effect explains: another that leaves more than that is no rival
COMPARABLE = 0.3  # of the score of an effect, that another has in its place: with less it is no rival
OTHER_START = 1.5  # times the power in torque that a look leaves: a fit that leaves more is begun from there, too


@dataclass(frozen=True)
class Round:
    """What was tried in one round: every candidate's score, the evidence of those fitted, and which was taken."""

    number: int
    now: Fit
    scores: tuple[Score, ...]
    tried: Mapping[str, Evidence]
    chosen: str | None


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
    weigher: Weigher
    say: Callable[[str], None] = lambda text: None
    whole: PredictionError | None = None
    samples: int = 0
    rounds: list[Round] = field(default_factory=list)
    rivals: dict[str, dict[str, Fit]] = field(default_factory=dict)
    dropped: list[tuple[str, str]] = field(default_factory=list)
    best: Fit = None  # type: ignore[assignment]
    inflation: dict[str, float] = field(default_factory=dict)  # of every effect that was added, beside all others
    _needed: dict[str, float] = field(default_factory=dict)  # support of an effect beside all others

    def __post_init__(self) -> None:
        self.best = self.base

    def run(self) -> Fit:
        """Add effects as long as one is worth it; judge each again beside the others; drop what is needless."""
        for number in range(1, MOST + 1):
            now = self.best
            scores, tried = self.tried(now)
            chosen = self.choice(tried)
            self.rounds.append(Round(number, now, tuple(scores), tried, chosen))
            if chosen is None:
                break
            new = tried[chosen]
            self.say(
                f"added {chosen}: log-likelihood +{0.5 * new.gain:.3g}, {100.0 * new.weight:.0f} % of the disturbance"
            )
            self.best = self.pruned(new.fit, [e for e in self._added(new.fit) if e != chosen])
        self.best = self.judged_again(self.best)
        self.best = self.pruned(self.best, [*self.best.structure.terms, *self._added(self.best)])
        return self.best

    @property
    def trusted(self) -> bool:
        """Whether the likelihood is right about every effect of its model, and so about the disturbance it leaves."""
        return all(self.inflation.get(e, 1.0) < TRUSTED for e in self._added(self.best))

    def scale(self, fit: Fit) -> Scale:
        """How large the motion is, and the lines in what a model predicts wrongly."""
        values, traces = fit.values, self.problem.traces
        inertia, damping, stiffness = (values.get((t,), 0.0) for t in TERMS)
        natural_hz = float(np.sqrt(max(stiffness, 0.0) / max(inertia, 1e-300)) / (2.0 * np.pi))
        left = fit.prediction.innovations
        noise = float(np.sqrt(fit.variance * self.problem.reading_variance))
        noise = float(np.sqrt(np.mean([np.mean(r[t.keep] ** 2) for r, t in zip(left, traces, strict=True)]))) or noise
        lines = foreign_lines_hz(traces, left, noise, natural_hz)
        scale = scale_of(traces, (inertia, damping, stiffness), lines, ringing_hz(traces, natural_hz))
        return replace(scale, rings_hz=rings_hz(traces, left, natural_hz))

    def names(self, now: Fit) -> list[str]:
        """What may be added, or put in the place of a special case; of an effect that is there, one more of it."""
        have = now.structure.effects
        more = [m for n in have for m in effects.further(effects.first_of(n)) if m not in have][:1]
        return [n for n in (*self.allowed, *more) if n not in have]

    def tried(self, now: Fit) -> tuple[list[Score], dict[str, Evidence]]:
        """All candidates' scores, and the evidence for the most promising, fitted."""
        names = self.names(now)
        looks = InnovationScores(self.problem, now, self.scale(now)).all(names)
        heavy = self.heaviest(now, names)
        short = self.shortlist(now, looks)
        starts: dict[str, list[Mapping[Name, float] | TorqueLook]] = {v[0].effect: [v[0].start] for v in short}
        for look in heavy:
            starts.setdefault(look.effect, []).append(look)
        fits = {n: f for n, s in starts.items() if (f := self.fitted(now, n, s)) is not None}
        most = max((now.cost - f.cost for f in fits.values()), default=0.0)
        fits = {n: self.further(f) if now.cost - f.cost > NEAR * most else f for n, f in fits.items()}
        return [v[0] for v in looks], {n: self.weigher.evidence(n, now, f) for n, f in fits.items()}

    def heaviest(self, now: Fit, names: Sequence[str]) -> list[TorqueLook]:
        """Candidates that carry much of the disturbance along the measured motion."""
        there = self.weigher.in_torque(now)
        left = self.weigher.left(there)
        nested = {s for e in now.structure.effects for s in effects.get(e).nests}
        held = [n for n in names if n not in nested and not set(effects.get(n).nests) & set(there.structure.effects)]
        looks = torque_looks(self.weigher.regression, there, held, HEAVIEST)
        floor = self.weigher.floor_nm**2
        return [w for w in looks if 1.0 - max(w.left_nm**2 - floor, 0.0) / left > WEIGHT]

    def shortlist(self, now: Fit, looks: Sequence[list[Score]]) -> list[list[Score]]:
        """The largest gains beyond their penalty, with their special cases and what comes first by order."""
        price = float(np.log(max(now.count, 2)))
        worth = [v for v in looks if v[0].gain > HOPE + price * len(effects.get(v[0].effect).parameters)]
        if not worth:
            return []
        plain = [v for v in worth if not simplicity(v[0].effect)]
        short = plain[:TRIED] + [v for v in worth if simplicity(v[0].effect)][:2]
        short = [v for v in short if v[0].gain > FAINT * worth[0][0].gain]
        wanted = {n for v in short for n in (*effects.get(v[0].effect).nests, *effects.get(v[0].effect).lower_order)}
        return short + [v for v in worth if v[0].effect in wanted and v not in short]

    def fitted(self, now: Fit, name: str, starts: Sequence[Mapping[Name, float] | TorqueLook]) -> Fit | None:
        """A candidate fitted on top of a model, in the place of what it contains: the best from all starts."""
        effect = effects.get(name)
        held = [e for e in self._added(now) if e in effect.nests]
        structure, rest = now.structure, {k: v for k, v in now.values.items() if k[0] not in held}
        linear = {p.name for p in effect.parameters if p.linear}
        for special in held:
            structure = structure.minus(special)
        fits: list[Fit] = []
        for start in starts:
            if isinstance(start, TorqueLook):  # the rest begins there, too, and the disturbance is looked for anew
                if not fits or self._leaves_more(fits[0], start):
                    begin = {**rest, **start.start}
                    fits.append(self.problem.fit(structure.plus(name), begin, None, FEW, thorough=False))
                continue
            own = {k: v for k, v in start.items() if k[0] == name}
            for special in held:
                own = {k: v + _gain(now, special) if k[1] in linear else v for k, v in own.items()}
            fits.append(
                self.problem.fit(structure.plus(name), {**rest, **own}, now.noise, FEW, carry=now.shots, thorough=False)
            )
        best = min(fits, key=lambda f: f.cost)
        return best if np.isfinite(best.cost) else None

    def _leaves_more(self, fit: Fit, start: TorqueLook) -> bool:
        """Whether a fit has missed what the same effect takes in torque."""
        left = self.weigher.left(self.weigher.in_torque(fit))
        return left > OTHER_START * self.weigher.left(start.fit)

    def further(self, fit: Fit) -> Fit:
        """The same with more steps."""
        more = self.problem.fit(fit.structure, fit.values, fit.noise, MANY, carry=fit.shots)
        return more if more.cost < fit.cost else fit

    def choice(self, tried: Mapping[str, Evidence]) -> str | None:
        """The candidate that is best supported, or the simplest of those that are as likely; None where none counts."""
        good = {n: e for n, e in tried.items() if e.support > HOPE and e.weight > WEIGHT}
        if not good:
            return None
        best = max(good.values(), key=lambda e: e.support)
        special = [
            n for n in effects.get(best.effect).nests
            if n in good
            and (good[n].support > SPECIAL * best.support or good[n].weight > best.weight - AS_HEAVY)
        ]  # fmt: skip
        if special:
            best = max((good[n] for n in special), key=lambda e: e.support)
        alike = [n for n, e in good.items() if e is best or e.behind(best) < APART]
        chosen = min(alike, key=lambda n: (*plainness(n), -good[n].support))
        lower = [n for n in effects.get(chosen).lower_order if n in good]
        return lower[0] if lower else chosen

    def judged_again(self, now: Fit) -> Fit:
        """Every named effect against all others in its place, beside the finished rest."""
        for name in self._added(now):
            if name not in now.structure.effects:
                continue
            bare = {k: v for k, v in now.values.items() if k[0] != name}
            rest = self.problem.fit(now.structure.minus(name), bare, now.noise, MANY, carry=now.shots, thorough=False)
            fits: dict[str, Fit] = {name: now}
            for other, fit in self._instead(now, rest, name).items():
                near = fit.penalised - now.penalised < FAR_BEHIND * (rest.cost - now.cost)
                fits[other] = self.further(fit) if near else fit
            seen = {n: self.weigher.evidence(n, rest, f) for n, f in fits.items()}
            self._needed[name] = seen[name].support
            chosen, alike = self._best_of(name, seen)
            self.inflation[chosen] = seen[chosen].inflation
            if chosen != name:
                self.say(f"replaced {name} by {chosen}: it fits better beside the other effects")
                now = fits[chosen]
            self.rivals.pop(name, None)
            self.rivals[chosen] = {n: fits[n] for n in alike if n != chosen}
        return now

    def _best_of(self, name: str, seen: Mapping[str, Evidence]) -> tuple[str, list[str]]:
        """Of an effect and others in its place, the one that is named, and all that are as likely."""
        best = seen[name]
        for other in seen.values():
            if other.weight > WEIGHT and other.support > best.support and other.behind(best) > APART:
                best = other
        alike = [n for n, e in seen.items() if e is best or (e.behind(best) < APART and e.weight > WEIGHT)]
        more = max(1.0, self.samples / max(best.fit.count, 1))
        close = [n for n, e in seen.items() if e is best or e.behind(best) < APART * more]
        close = [n for n in close if not self._cannot_gain(seen, n, close, more)]
        if len(close) > 1 and self.whole is not None:
            decisive = max(seen[n].inflation for n in close)
            return decided({n: self.on_all(seen[n].fit) for n in close}, decisive)
        return min(alike, key=lambda n: (*plainness(n), -seen[n].support)), alike

    @staticmethod
    def _cannot_gain(seen: Mapping[str, Evidence], rich: str, close: Sequence[str], more: float) -> bool:
        """Whether an effect holds a simpler one and is no likelier, so that more samples will not make it so."""
        return any(
            (seen[rich].gain - seen[n].gain) * more < seen[rich].price - seen[n].price
            for n in effects.get(rich).nests if n in close
        )  # fmt: skip

    def on_all(self, fit: Fit) -> Fit:
        """The same model on all samples."""
        assert self.whole is not None
        return self.whole.fit(fit.structure, fit.values, self.whole.within(fit.noise), MANY)

    def _instead(self, now: Fit, rest: Fit, name: str) -> dict[str, Fit]:
        """Fits with another effect in the place of one."""
        looks = InnovationScores(self.problem, rest, self.scale(rest)).all(self.names(rest))
        fits: dict[str, Fit] = {}
        rest_values = {n: v for n, v in now.values.items() if n[0] != name}
        for other in effects.get(name).nests:  # from where the richer one stands: alone its score may point anywhere
            parameters = effects.get(other).parameters
            if other not in self.names(now) or not all(p.linear and not p.per_run for p in parameters):
                continue
            structure = replace(now.structure, effects=tuple(other if e == name else e for e in now.structure.effects))
            own: dict[Name, float] = {(other, p.name): _gain(now, name) for p in parameters}
            fits[other] = self.problem.fit(
                structure, {**rest_values, **own}, now.noise, FEW, carry=now.shots, thorough=False
            )
        own_score = next((v[0].gain for v in looks if v[0].effect == name), 0.0)
        for group in self.shortlist(rest, looks):
            other = group[0].effect
            if other == name or group[0].gain < COMPARABLE * own_score:
                continue
            found = self.fitted(rest, other, [group[0].start])
            if found is not None and (other not in fits or found.cost < fits[other].cost):
                fits[other] = found
        return {n: f for n, f in fits.items() if np.isfinite(f.cost)}

    def _added(self, now: Fit) -> list[str]:
        return [e for e in now.structure.effects if e not in self.base.structure.effects]

    def pruned(self, now: Fit, names: Sequence[str]) -> Fit:
        """Without every term or effect that the data do as well without."""
        for name in names:
            kept_by = [e for e in now.structure.effects if name in effects.get(e).lower_order]
            if name == "inertia" or kept_by or len(now.structure.terms) + len(now.structure.effects) <= 1:
                continue
            own = [n for n in now.names if n[0] == name]
            term = len(own) == 1 and own[0][0] in TERMS
            if not self._asked(now, name, own):
                continue
            start = {n: v for n, v in now.values.items() if n[0] != name}
            without = self.problem.fit(
                now.structure.minus(name), start, now.noise, FEW, carry=now.shots, thorough=False
            )
            evidence = self.weigher.evidence(name, without, now)
            soaks = name == "stiffness" and self._may_soak(now)
            light = evidence.weight < WEIGHT and (name not in TERMS or soaks)
            if evidence.support > APART and not light:
                continue
            why = f"log-likelihood {0.5 * evidence.gain:.3g} lower without it"
            if term and light:
                why = "it carries no torque that the others do not"
            self.dropped.append((name, why))
            self.say(f"dropped {name}")
            now = without
        return now

    def _may_soak(self, now: Fit) -> bool:
        """Whether the spring is so weak that it may only soak up what is constant over a run, or pushes."""
        pull = now.values.get(("stiffness",), 0.0) * self.problem.angle_rad
        return disturbed(now) > AT_NOISE and pull < WEIGHT * self.problem.torque_nm

    def _asked(self, now: Fit, name: str, own: Sequence[Name]) -> bool:
        """Whether it is in doubt that a term or an effect is needed."""
        if name == "stiffness" and self._may_soak(now):
            return True
        if name in TERMS:
            return abs(now.values[own[0]]) < CERTAIN * now.std_error(own[0])
        return self._needed.get(name, 0.0) < CERTAIN**2


def _gain(fit: Fit, name: str) -> float:
    """An effect's first gain."""
    return next((fit.values[(name, p.name)] for p in effects.get(name).parameters if p.linear and not p.per_run), 0.0)


def decided(fits: Mapping[str, Fit], inflation: float = 1.0) -> tuple[str, list[str]]:
    """The simplest of the likeliest, and all that are as likely."""
    best = min(f.penalised for f in fits.values())
    alike = [n for n in fits if fits[n].penalised - best < APART * inflation]
    return min(alike, key=lambda n: (*plainness(n), fits[n].penalised)), alike


def plainness(name: str) -> tuple[int, int]:
    """What goes first among candidates that do as well: no channel, fewer parameters."""
    return simplicity(name), len(effects.get(name).parameters)
