"""The search: effects added one at a time to a model fitted by prediction error, each asked again beside the others.

Every model has its own disturbance. While an effect is missing its torque counts as disturbance and the prediction
leans on the measurements; as effects are found the disturbance shrinks, down to the sensor's noise where all is found.
So one likelihood judges all models, from the first that lacks everything to the last.
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
from identify.runs.measured_channels import simplicity
from identify.signals.spectral_lines import foreign_lines_hz, ringing_hz, rings_hz
from rig import effects
from rig.effects.base import Place, Scale
from rig.platform import TERMS

TRIED = 4  # candidates of a round that are fitted
HOPE = 20.0  # fall of the cost, beyond the penalty, that no chance among all candidates and shapes makes
APART = 10.0  # fall of the penalised cost that parts two models (Kass and Raftery 1995: very strong)
FAINT = 0.02  # of the best score: what promises so little is not what the round is about
MOST = 6  # effects that one recording is believed to show
FEW, MANY = 8, 20  # steps of a fit that is compared, and of one that is kept
CERTAIN = 30.0  # standard errors beyond which nobody asks whether a term is needed
NEAR = 0.9  # of the best fall of the cost in a round: such a fit is taken to its end before it is judged
FAR_BEHIND = 0.2  # of what an effect explains: another that leaves more than that is no rival
PATIENCE = 3  # effects after which the sensor's noise must be near
AT_NOISE = 1.1  # times the noise's variance
OTHER_START = 1.5  # times the other: gains that far apart are both begun from
SPECIAL = 0.5  # of the fall of a richer effect that its special case brings to be tried first


@dataclass(frozen=True)
class Round:
    """What was tried in one round: every candidate's score, the fits, and which was taken."""

    number: int
    now: Fit
    scores: tuple[Score, ...]
    tried: Mapping[str, Fit]
    chosen: str | None


@dataclass
class Stepwise:
    """The search over structures on one problem."""

    problem: PredictionError
    base: Fit
    allowed: Sequence[str]
    say: Callable[[str], None] = lambda text: None
    whole: PredictionError | None = None
    samples: int = 0
    in_torque: Callable[[Fit, str], Mapping[Name, float] | None] = lambda now, name: None
    rounds: list[Round] = field(default_factory=list)
    rivals: dict[str, dict[str, Fit]] = field(default_factory=dict)
    dropped: list[tuple[str, str]] = field(default_factory=list)
    best: Fit = None  # type: ignore[assignment]  # the model that is believed so far
    _needed: dict[str, float] = field(default_factory=dict)  # rise of the penalised cost without an effect

    def __post_init__(self) -> None:
        self.best = self.base

    def run(self) -> Fit:
        """Add effects as long as one is worth it; ask each again beside the others; drop what is needless."""
        for number in range(1, MOST + 1):
            now = self.best
            if len(self._added(now)) >= PATIENCE and disturbed(now) > AT_NOISE:
                break  # more than that resemble anything
            scores, tried = self.tried(now)
            chosen = self.choice(now, tried)
            self.rounds.append(Round(number, now, tuple(scores), tried, chosen))
            if chosen is None:
                break
            new = tried[chosen]
            self.say(f"added {chosen}: log-likelihood +{0.5 * (now.cost - new.cost):.4g}")
            self.best = self.pruned(new, [e for e in self._added(new) if e != chosen])
        self.best = self.asked_again(self.best)
        self.best = self.pruned(self.best, [*self.best.structure.terms, *self._added(self.best)])
        return self.best

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
        """What may be added, or put in the place of a special case."""
        have = now.structure.effects
        return [n for n in self.allowed if n not in have]

    def tried(self, now: Fit) -> tuple[list[Score], dict[str, Fit]]:
        """All candidates' scores, and fits of the most promising."""
        looks = InnovationScores(self.problem, now, self.scale(now)).all(self.names(now))
        scores = [v[0] for v in looks]
        tried: dict[str, Fit] = {}
        for group in self.shortlist(now, looks):
            best = None
            for s in group[:1]:
                fit = self.fitted(now, s)
                if fit is not None and (best is None or fit.cost < best.cost):
                    best = fit
            if best is not None:
                tried[group[0].effect] = best
        most = max((now.cost - f.cost for f in tried.values()), default=0.0)
        return scores, {n: self.again(f) if now.cost - f.cost > NEAR * most else f for n, f in tried.items()}

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

    def fitted(self, now: Fit, score: Score) -> Fit | None:
        """A candidate fitted on top of a model, in the place of what it contains."""
        effect = effects.get(score.effect)
        held = [e for e in self._added(now) if e in effect.nests]
        structure, start = now.structure, {k: v for k, v in now.values.items() if k[0] not in held}
        own = dict(score.start)
        linear = {p.name for p in effect.parameters if p.linear}
        for name in held:
            structure = structure.minus(name)
            own = {k: v + _gain(now, name) if k[1] in linear else v for k, v in own.items()}
        fit = self.problem.fit(structure.plus(effect.name), {**start, **own}, now.noise, FEW, carry=now.shots)
        if effect.place is Place.FRICTION:  # where it sticks depends on how large it is: from too little it stays there
            other = self.in_torque(now, effect.name)
            if other is not None and far_apart({**start, **own}, other, effect.name):
                values = {**start, **own, **other}
                fit = min(fit, self.problem.fit(structure.plus(effect.name), values, None, FEW), key=lambda f: f.cost)
        return fit if np.isfinite(fit.cost) else None

    def again(self, fit: Fit) -> Fit:
        """The same with more steps."""
        more = self.problem.fit(fit.structure, fit.values, fit.noise, MANY, carry=fit.shots)
        return more if more.cost < fit.cost else fit

    def choice(self, now: Fit, tried: Mapping[str, Fit]) -> str | None:
        """The likeliest candidate, or the simplest of those that are as likely; None where none is worth it."""
        good = {n: f for n, f in tried.items() if now.penalised - f.penalised > HOPE}
        if not good:
            return None
        best = min(good, key=lambda n: good[n].penalised)
        nested = [n for n in effects.get(best).nests if n in good]
        nested = [n for n in nested if now.cost - good[n].cost > SPECIAL * (now.cost - good[best].cost)]
        if nested:
            best = min(nested, key=lambda n: good[n].cost)
        alike = [n for n in good if good[n].penalised - good[best].penalised < APART]
        best = min(alike, key=lambda n: (*plainness(n), good[n].penalised))
        lower = [n for n in effects.get(best).lower_order if n in good]
        return lower[0] if lower else best

    def asked_again(self, now: Fit) -> Fit:
        """Every named effect against all others in its place, beside the finished rest."""
        for name in self._added(now):
            if name not in now.structure.effects:
                continue
            bare = {k: v for k, v in now.values.items() if k[0] != name}
            rest = self.problem.fit(now.structure.minus(name), bare, None, MANY, carry=now.shots)
            fits: dict[str, Fit] = {name: now}
            for other, fit in self._instead(now, rest, name).items():
                near = fit.penalised - now.penalised < FAR_BEHIND * (rest.cost - now.cost)
                fits[other] = self.again(fit) if near else fit
            self._needed[name] = rest.penalised - now.penalised
            close = self.undecided(fits)
            if len(close) > 1 and self.whole is not None:
                close = {n: self.on_all(f) for n, f in close.items()}
            chosen, alike = decided(close)
            if chosen != name:
                self.say(f"replaced {name} by {chosen}: it fits better beside the other effects")
                now = fits[chosen]
            self.rivals.pop(name, None)
            self.rivals[chosen] = {n: fits[n] for n in alike if n != chosen}
        return now

    def undecided(self, fits: Mapping[str, Fit]) -> dict[str, Fit]:
        """Those that all samples may still find best: by as much as more samples tell."""
        more = max(1.0, self.samples / max(next(iter(fits.values())).count, 1))
        best = min(f.penalised for f in fits.values())
        close = {n: f for n, f in fits.items() if f.penalised - best < APART * more}

        def cannot_gain(rich: str) -> bool:  # it holds a simpler one and is no likelier: nor will it be
            return any(
                (close[n].cost - close[rich].cost) * more < close[rich].penalised - close[rich].cost
                - (close[n].penalised - close[n].cost)
                for n in effects.get(rich).nests if n in close
            )  # fmt: skip

        return {n: f for n, f in close.items() if not cannot_gain(n)}

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
            fits[other] = self.problem.fit(structure, {**rest_values, **own}, now.noise, FEW, carry=now.shots)
        for group in self.shortlist(rest, looks):
            other = group[0].effect
            if other == name:
                continue
            found = self.fitted(rest, group[0])
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
            if self._needed.get(name, 0.0) > CERTAIN**2:
                continue
            if len(own) == 1 and own[0][0] in TERMS and abs(now.values[own[0]]) > CERTAIN * now.std_error(own[0]):
                continue
            start = {n: v for n, v in now.values.items() if n[0] != name}
            without = self.problem.fit(now.structure.minus(name), start, now.noise, FEW, carry=now.shots)
            if without.penalised - now.penalised > APART:
                continue
            self.dropped.append((name, f"log-likelihood {0.5 * (now.cost - without.cost):.3g} lower without it"))
            self.say(f"dropped {name}")
            now = without
        return now


def _gain(fit: Fit, name: str) -> float:
    """An effect's first gain."""
    return next((fit.values[(name, p.name)] for p in effects.get(name).parameters if p.linear and not p.per_run), 0.0)


def far_apart(some: Mapping[Name, float], other: Mapping[Name, float], name: str) -> bool:
    """Whether two starts of an effect differ so much in a gain that a fit from one may not come to the other."""
    gains = [(name, p.name) for p in effects.get(name).parameters if p.linear and not p.per_run]
    return any(max(abs(some.get(g, 0.0)), abs(other.get(g, 0.0))) > OTHER_START * min(
        abs(some.get(g, 0.0)), abs(other.get(g, 0.0))) for g in gains)  # fmt: skip


def disturbed(fit: Fit) -> float:
    """By how much more than the sensor's noise the prediction errs: one where no torque disturbs."""
    kept = [v[s.weight] for v, s in zip(fit.prediction.variance, fit.shots, strict=True)]
    return float(np.median(np.concatenate(kept)))


def decided(fits: Mapping[str, Fit]) -> tuple[str, list[str]]:
    """The simplest of the likeliest, and all that are as likely."""
    best = min(f.penalised for f in fits.values())
    alike = [n for n in fits if fits[n].penalised - best < APART]
    return min(alike, key=lambda n: (*plainness(n), fits[n].penalised)), alike


def plainness(name: str) -> tuple[int, int, bool]:
    """What goes first among candidates that do as well: no channel, fewer parameters, the drive before the sensor."""
    effect = effects.get(name)
    return simplicity(name), len(effect.parameters), effect.place is Place.SENSOR


def start_of(platform: tuple[float, float, float], terms: Sequence[str]) -> dict[Name, float]:
    """Values of J, C, K to begin from."""
    return {(k,): v for k, v in zip(TERMS, platform, strict=True) if k in terms}
