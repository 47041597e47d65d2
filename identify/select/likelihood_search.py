"""The search by prediction error on one recording: on samples that tell most, decided on all where models lie close."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.bounds.separation import support_difference
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import Start, scale_of
from identify.estimate.starting_point import horizon_s
from identify.likelihood.fit import Fit
from identify.likelihood.normal_equations import COST_TOLERANCE
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores, Score
from identify.propose.motion_scale import scale_at
from identify.results import TAKEN_BACK, Candidate
from identify.runs.holdout import Split
from identify.runs.observability import can_show
from identify.runs.reduced import reduced
from identify.select.curve_rivals import is_part_of
from identify.select.evidence import PREDICTS_TO_NOISE, STRONG_SUPPORT, EvidenceModel
from identify.select.forward_selection import Round, add_effects
from identify.select.lags import INERTIA, drives, exchanged
from identify.select.search_state import Search
from identify.select.stepwise import Stepwise
from identify.signals.torque_noise import quieter
from identify.signals.trace import Trace, pooled_noise, release
from rig.platform import TERMS

SAMPLES = 10_000  # that the search looks at
MAX_CUTOFF_SHARE = 0.2  # of the sample rate: the low-pass for a first guess in torque cuts off no higher
RIVAL_SAMPLES = 40_000  # samples on which rivals are parted
BEYOND_SAMPLES = 25_000  # with which a search goes on: what its candidates do to so many takes half a gibibyte
MIN_MORE_SAMPLES_RATIO = 1.5  # times the samples: else there is nothing more to be seen in all of them
# Times the score that a candidate has on the samples of the search, for as many: more on all is not to be seen on those
# (a torque that only a later resonance limits, a lag that a slow beginning hides). Set by hand.
BEYOND_RATIO = 4.0
DECLARED_WITHIN = 2.0  # factor that a declared inertia may be off by, as the check of the motion takes it
EXCESS_SIGMAS = 3.0  # by which the innovations of all may be larger than those of a part by chance


@dataclass
class LikelihoodSearch:
    """The search by prediction error on one recording.

    Attributes
    ----------
    stepwise
        The search over structures.
    found
        What it found so far, for the report.
    """

    stepwise: Stepwise
    traces: Sequence[Trace]
    structure: Structure
    start: Start
    more: tuple[Sequence[Trace], Split] | None = None  # of the recording, than the search looks at
    earlier: tuple[Round, ...] = ()  # of a search that looked at less
    declared_inertia: float = 0.0

    @classmethod
    def of(
        cls, traces: Sequence[Trace], split: Split, structure: Structure, declared: Mapping[Name, float], start: Start,
        allowed: Sequence[str], say: Callable[[str], None],
    ) -> LikelihoodSearch:  # fmt: skip
        """The search, its first model fitted.

        Parameters
        ----------
        declared
            Values of the declared model: effects begin there, and J, C, K where that fits better.
        start
            A first idea of the platform.
        """
        few, parts = reduced(traces, split, SAMPLES)
        problem = PredictionError(few)
        guessed: dict[Name, float] = {(k,): v for k, v in zip(TERMS, start.platform, strict=True)}
        first = {**declared, **guessed}
        base = problem.fit(structure, first)
        if base.reduced_chi_square > PREDICTS_TO_NOISE:  # of two minima this may be the other
            twin = problem.fit(structure, {**guessed, **declared}, base.noise, thorough=False)
            if twin.cost < base.cost - COST_TOLERANCE:
                base = min((base, problem.fit(structure, twin.values)), key=lambda f: f.cost)
        count = sum(t.count for t in traces)
        whole, more = None, None
        if count > MIN_MORE_SAMPLES_RATIO * base.count:
            whole = PredictionError(reduced(traces, split, RIVAL_SAMPLES)[0])
            more = reduced(traces, split, BEYOND_SAMPLES)
        offered = [n for n in allowed if n not in structure.effects and can_show(n, traces)]
        weigher = _weigher(problem, few, parts, start, base)
        stepwise = Stepwise(problem, base, offered, weigher, say, whole, count)
        return cls(stepwise, traces, structure, start, more, declared_inertia=declared.get(INERTIA, 0.0))

    def run(self) -> bool:
        """Search; whether the last model predicts down to the sensor's noise."""
        less = self.stepwise = self.stepwise.run()
        if self.more is not None and (beyond := self._beyond(*self.more)) is not None:
            add_effects(beyond)
            if _shows_more(beyond.best, less.best) and _shows_more((there := beyond.concluded()).best, less.best):
                release(less.problem.traces)
                self.earlier, self.stepwise = tuple(less.rounds), there
        return self._nearer(self.stepwise.best).reduced_chi_square < PREDICTS_TO_NOISE

    def _nearer(self, best: Fit) -> Fit:
        """The best model; with platform and lag exchanged where that is as likely and the declared inertia says so.

        It says so where it is right to a factor of two of the one and not of the other: it may be a default.
        """
        values, declared = exchanged(best), self.declared_inertia
        if values is None or declared <= 0.0:
            return best
        there, here = (abs(np.log(v[INERTIA] / declared)) for v in (values, best.values))
        if not there < np.log(DECLARED_WITHIN) < here:
            return best
        other = self.stepwise.problem.fit(best.structure, values, best.noise)
        if np.isfinite(other.cost) and support_difference(other, best) < STRONG_SUPPORT:
            self.stepwise.best = other
        return self.stepwise.best

    def _beyond(self, traces: Sequence[Trace], parts: Split) -> Stepwise | None:
        """A search that goes on from the best model with more of the recording; None where that shows nothing else.

        The samples that tell J, C, K and friction best need not show every effect.
        """
        less, problem = self.stepwise, PredictionError(traces)
        best = problem.fit(less.best.structure, less.best.values, problem.noise_of(less.best), 0, thorough=False)
        scatter = float(np.sqrt(2.0 / less.best.count))  # of a mean square of white innovations
        here, there = less.best.variance / less.problem.reading_variance, best.variance / problem.reading_variance
        if there < (1.0 + EXCESS_SIGMAS * scatter) * here:
            return None  # all is predicted as well as that part of it
        best = problem.fit(best.structure, best.values, best.noise)
        if not np.isfinite(best.cost):
            return None
        names = less.trials.names(best)
        more = BEYOND_RATIO * best.count / less.best.count
        seen = {v[0].effect: more * v[0].gain for v in _scores(less.problem, less.best, names)}
        looks = less.trials.shortlist(best, _scores(problem, best, names))
        if all(v[0].gain < seen.get(v[0].effect, 0.0) for v in looks):
            return None
        less.say(f"searching on with {best.count} samples: they show an effect that the first {less.best.count} do not")
        base = problem.fit(less.base.structure, less.base.values, problem.noise_of(less.base))
        out = less.apart(
            problem=problem, base=base, weigher=_weigher(problem, traces, parts, self.start, base), whole=None,
            rounds=[], settled=frozenset(less.trials.added(best)), left=None, in_place=None, doubtful=[], _on_all={},
        )  # fmt: skip
        out.best = best
        return out

    def refutes(self, structure: Structure, values: Mapping[Name, float]) -> bool:
        """Whether the best model is likelier than one found in torque, also where that has its own best numbers.

        A curve that is believed beside the best model belongs to it where all that was found is of the kind that the
        curve stands for: what it shows is not another effect of that kind.
        """
        search = self.stepwise
        if structure == search.best.structure:
            return False
        left, added = search.left, [e for e in structure.effects if e not in search.base.structure.effects]
        beside = left is not None and all(is_part_of(e, left.form) for e in added)
        best = left.evidence.fit if left is not None and beside else search.best
        there = search.problem.fit(structure, values)
        if drives(there) and not drives(best):  # it has taken for damping what is none
            return True
        return bool(np.isfinite(there.cost)) and support_difference(there, best) > STRONG_SUPPORT

    @property
    def found(self) -> Search:
        """What was looked at so far, as the report tells it."""
        return self.found_as(self.stepwise.best)

    def found_as(self, best: Fit) -> Search:
        """The same with a model that has something less."""
        s = self.stepwise
        base = s.base
        horizon = horizon_s(tuple(base.values.get((t,), 0.0) for t in TERMS), self.traces)  # type: ignore[arg-type]
        noise = pooled_noise(self.traces)
        found = Search(_with_disturbance(base, noise), _with_disturbance(best, noise), horizon, noise)
        named = [e for e in best.structure.effects if e not in base.structure.effects]
        for r in (*self.earlier, *s.rounds):
            for score in r.scores:
                seen = r.tried.get(score.effect)
                fit = seen.fit if seen is not None else None
                bic = -seen.support if seen is not None else -score.gain
                found.candidates.append(
                    Candidate(score.effect, r.number, bic, None, _status(score.effect, r.added, named, fit))
                )
        rivals = {k: s.rivals.get(k, {}) for k in named}
        found.rivals = {k: tuple(v) for k, v in rivals.items()}
        found.rival_models = {k: {n: f.platform() for n, f in v.items()} for k, v in rivals.items()}
        apart = {k: s.between_rivals[k] for k in named if k in s.between_rivals}
        same = set(best.structure.effects)  # what was found of a model that has changed since tells nothing
        found.between_rivals = {k: v for k, (structure, v) in apart.items() if set(structure.effects) == same}
        found.dropped = [(n, why) for n, why in s.dropped if n not in (*best.structure.terms, *best.structure.effects)]
        return found


def _shows_more(fit: Fit, than: Fit) -> bool:
    """Whether a model has an effect that another lacks."""
    return not set(fit.structure.effects) <= set(than.structure.effects)


def _scores(problem: PredictionError, fit: Fit, names: Sequence[str]) -> list[list[Score]]:
    return InnovationScores(problem, fit, scale_at(problem, fit)).all(names)


def _weigher(problem: PredictionError, traces: Sequence[Trace], parts: Split, start: Start, base: Fit) -> EvidenceModel:
    cutoff_hz = min(start.cutoff_hz, MAX_CUTOFF_SHARE / traces[0].step_s)
    regression = TorqueRegression(traces, parts, cutoff_hz, scale_of(traces, start.platform, ()))
    return EvidenceModel(problem, regression, regression.noise_floor_nm(base.values))


def start_search(
    traces: Sequence[Trace], begin: Callable[[Sequence[Trace]], LikelihoodSearch]
) -> tuple[LikelihoodSearch, float | None]:
    """The search on the runs whose declared model is likelier, and how large the noise was that their torque lost.

    None where it was not filtered.
    """
    search = begin(traces)
    less = None if all(t.torque is None for t in traces) else quieter(traces)
    if less is None:
        return search, None
    quiet, noise_nm = less
    other = begin(quiet)
    if other.stepwise.base.cost > search.stepwise.base.cost - STRONG_SUPPORT:
        return search, None
    return other, noise_nm


def filtered(noise_nm: float, axis: str) -> str:
    """That the recorded torque was filtered, as the report says it."""
    torque, unit = ("force", "N") if axis == "linear" else ("torque", "N·m")
    noise = f"{noise_nm:.2g} {unit} rms of it is noise that the platform does not follow"
    return f"the recorded {torque} is filtered: {noise}"


def _status(name: str, added: Sequence[str], named: Sequence[str], fit: Fit | None) -> str:
    if name in added:
        return "added" if name in named else TAKEN_BACK
    if fit is None:
        return "screened out"
    return "no better" if added else "too little evidence"


def _with_disturbance(fit: Fit, noise: float) -> Fit:
    """A fit that leaves what its disturbance moves, too; ``noise`` is the sensor's, as the runs show it.

    A large disturbance that follows every reading leaves a fit no noise of the sensor to tell. Where the sensor's noise
    is known to be more than all that is predicted wrongly, nothing disturbs.
    """
    wrong = np.concatenate([e[s.weight, 0] for e, s in zip(fit.prediction.innovations, fit.shots, strict=True)])
    rms = float(np.sqrt(np.mean(wrong**2)))
    return replace(fit, variance=rms**2 if rms < noise else max(fit.variance, noise**2) * fit.reduced_chi_square)
