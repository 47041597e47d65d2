"""What may be added to a model that runs free: scored, fitted on top of it over whole runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.channels import simplicity
from identify.choice import STILL_FAR
from identify.compare import Judged, start_values
from identify.holdout import Split
from identify.lines import foreign_lines_hz, ringing_hz, rings_hz
from identify.output_error import refine, squares_at
from identify.pairs import Pair, pairs
from identify.parameters import Name
from identify.regression import Structure
from identify.scores import Scored, Scores
from identify.screen import Screen, first_guess, scale_of
from identify.traces import Trace
from identify.whole_runs import AT_FLOOR, CHANCE, ENDS_NEAR, NEAR_THEN, STEPS, TWICE, Whole, fit_whole
from rig import effects
from rig.effects.base import Place, Scale
from rig.platform import TERMS

TRIED = 4  # candidates of a round that are fitted
CHANNELS_TRIED = 2  # effects of measured channels, beside them
WORTH_A_FIT = 15.0  # expected fall of chi square
SHOWN = 6.0  # fall of chi square on that part at which the whole is looked at
MOST_SHOWN = 10
PLAIN = 300.0  # fall of chi square on that part at which it tells enough
LONG = 14_000  # samples; of a longer recording a first part is scored first
FEW_STEPS = 8  # of a fit that is only compared
TAKEN_ON = 4  # times as many as a fit has, while each time the squares fall
GOING = 0.95  # to less than this share
FAR_BEHIND = 0.7  # of the best score: not fitted any more once another candidate is at the floor
WALKED = 2  # times that other minima are looked for from the best so far
FINER, SHARPER = 3, 2  # times the steps, and how often they are made finer
FAINT = 0.03  # of the best score: what promises so little beside another is not what the round is about
VERY_FAR = 1e4  # mean square over the noise's variance: there whole runs have false minima on the way down
MOST_OF_IT = 0.2  # of the squares: a candidate that leaves less is there, whatever else is missing
HOPELESS = 3.0  # times the best error of the round after three steps


class Candidates:
    """All that the library offers for one recording.

    Parameters
    ----------
    traces, split
        The runs, and which of their samples fit and judge.
    allowed
        Names of the effects that may be named at all.
    declared
        Those that the model has from the start.
    """

    def __init__(
        self, traces: Sequence[Trace], split: Split, allowed: Sequence[str], declared: Sequence[str] = ()
    ) -> None:
        self.traces, self.split, self.declared = traces, split, tuple(declared)
        self.fit = [i for i, m in enumerate(split.fit) if np.any(m)]
        self.noise = float(np.sqrt(np.mean([t.noise**2 for t in traces])))
        self.torque_free = all(t.torque is None for t in traces)
        self.fixed: list[Name] = [("inertia",)] if self.torque_free else []
        self.allowed = [n for n in allowed if self._possible(n)]
        self.finer = 1  # times the fine steps that models are compared with
        self.horizon = 1.0  # of a first fit over short runs, in seconds
        self.moving = float(np.std(np.concatenate([traces[i].measured[split.fit[i]] for i in self.fit])))

    def _possible(self, name: str) -> bool:
        """A bias is a nuisance; a constant torque only shifts the unseen rest angle behind a gyro."""
        if name == "rate_bias" or (self.torque_free and effects.get(name).place is Place.DRIVE):
            return False
        if effects.get(name).needs_added_inertia and not _loads_differ(self.traces):
            return False
        return not (name == "torque_offset" and all(t.biased for t in self.traces))

    def whole(
        self, structure: Structure, start: Mapping[Name, float], hopeless: float = np.inf, steps: int = STEPS
    ) -> Whole | None:
        """A structure fitted over whole runs; None where it runs away."""
        return fit_whole(
            self.traces, self.split, structure, start, self.noise, self.fixed, hopeless, steps, self.finer
        )  # fmt: skip

    def tried(self, now: Whole, most: int = TRIED, in_full: bool = False) -> tuple[dict[str, Whole], list[Scored]]:
        """The most promising candidates, fitted on top of a model, and all that were looked at.

        ``in_full`` scores on all samples at once: what a decay tells is in how it ends.
        """
        looks = self._looks(now, [n for n in self.allowed if n not in now.structure.effects], in_full)
        tried: dict[str, Whole] = {}
        short = self._shortlist(looks, now, most, 0.0 if in_full else FAINT)  # far off a decay's scores point anywhere
        for look in sorted(short, key=lambda s: -s.gain):  # where that is the one, the others need no fit
            best = min(tried.values(), key=lambda w: w.squares, default=now)
            holds_it = best.at_noise and look.effect in effects.get(best.structure.effects[-1]).nests
            behind = look.gain < FAR_BEHIND * short[0].gain and not _is_like(look.effect, tried)
            if best.at_noise and behind and not holds_it:
                continue
            fitted = self._within(now, look, best) if holds_it else self._from(now, look, best)
            if fitted is not None:
                tried[look.effect] = fitted
        best = min(tried.values(), key=lambda w: w.squares, default=now)
        if best.level > STILL_FAR and best.squares > MOST_OF_IT * now.squares:
            tried |= self._seen_otherwise(now, tried, best)
            best = min(tried.values(), key=lambda w: w.squares, default=now)
        for name, w in list(tried.items()):
            simpler = [tried[n] for n in effects.get(name).nests if n in tried]
            chosen_anyway = any(n.squares < TWICE * w.squares for n in simpler)
            if not best.at_noise and w.squares < NEAR_THEN * best.squares and not chosen_anyway:
                further = self.taken_on(w)
                tried[name] = self.elsewhere(further, name) if further.level < STILL_FAR else further
        return self._sharp({n: w for n, w in tried.items() if not w.at_noise}, tried), looks

    def sharp(self, now: Whole) -> Whole:
        """A model near the noise, simulated as finely as it takes for its error not to be the simulation's."""
        return self._sharp({"": now}, {"": now})[""]

    def _sharp(self, asked: dict[str, Whole], tried: dict[str, Whole]) -> dict[str, Whole]:
        """What would be nearer the noise in finer steps is fitted with finer ones, and all that follows is.

        Beside a quiet gyro the error of a coarse simulation is thousands of chi square, which anything takes away.
        """
        near = {n: w for n, w in asked.items() if w.level < ENDS_NEAR}
        traces, use = [self.traces[i] for i in self.fit], [self.split.fit[i] for i in self.fit]
        for _ in range(SHARPER):
            finer = FINER * self.finer
            if not any(
                w.squares - squares_at(traces, w.structure, w.values(), use, finer) / self.noise**2 > CHANCE
                for w in near.values()
            ):
                break
            self.finer = finer
            fitted = {n: self.whole(w.structure, w.values()) for n, w in near.items()}
            tried = tried | {n: w for n, w in fitted.items() if w is not None}
            near = {n: tried[n] for n in near}
        return tried

    def elsewhere(self, now: Whole, name: str) -> Whole:
        """The same effects, one of them begun where its other minima may lie: the best of all fits.

        From a better one it is looked for again: a mode that slow torque hardly tells from others is walked up to.
        """
        effect, best = effects.get(name), now
        for _ in range(WALKED if effect.other_minima and not self.torque_free else 0):  # a decay tells no inertia
            at, values = best, best.values()
            jck = tuple(values.get((t,), 0.0) for t in TERMS)
            own = tuple(values[(name, p.name)] for p in effect.parameters)
            others = effect.other_minima(jck, own, self._scale(at)) if effect.other_minima else ()  # type: ignore[arg-type]
            for other in others:
                start: dict[Name, float] = dict(values)
                start |= {(t,): v for t, v in other.terms.items()}
                start |= {(name, p): v for p, v in other.own.items()}
                there = best.at_noise and not now.at_noise
                fitted = None if there else self.whole(now.structure, start)
                if fitted is not None and fitted.squares < best.squares:
                    best = self.taken_on(fitted)
            if best.at_noise or best.squares > GOING * at.squares:  # at the noise once is enough
                break
        return best

    def large(self, found: Judged) -> Whole | None:
        """With an effect that is no small addition, begun where the regression along the measured motion sees it.

        A second inertia as heavy as the first has two resonances: no model with one of them runs near the data.
        """
        traces, structure = [self.traces[i] for i in self.fit], found.structure
        best: Whole | None = None
        for name in self.allowed:
            if effects.get(name).large_starts is None or name in structure.effects:
                continue
            screen = Screen(traces, structure, found.shapes(), first_guess(traces, Structure(structure.terms)))
            fitted = self._as_seen(screen, name, structure, found.values())
            if fitted is not None and (best is None or fitted.squares < best.squares):
                best = self.taken_on(fitted)
        return best

    def _as_seen(self, screen: Screen, name: str, structure: Structure, values: Mapping[Name, float]) -> Whole | None:
        """A candidate fitted from where the regression along the measured motion sees it."""
        look = screen.look(name)
        if look is None or look.gain < WORTH_A_FIT:
            return None
        start = start_values(screen.solution(look), look.shapes, 1 + max(t.number for t in self.traces))
        return self.whole(structure.plus(name), {**values, **start})

    def _seen_otherwise(self, now: Whole, tried: Mapping[str, Whole], best: Whole) -> dict[str, Whole]:
        """What no score along a motion that is far off shows, as the regression along the measured motion sees it.

        A drive that saturates at half its torque is scored best where it hardly does, if its motion is far off; a light
        mode near a tone of the torque hides behind all that follows the resonance. Last come the large starts.
        """
        out: dict[str, Whole] = {}
        traces, structure = [self.traces[i] for i in self.fit], now.structure
        gainless = [n for n in tried if not any(p.linear for p in effects.get(n).parameters)]
        untried = [n for n in self.allowed if n not in tried and n not in structure.effects]
        changing = [n for n in untried if effects.get(n).large_starts is not None]
        if not self.torque_free and (gainless or changing):
            screen = Screen(
                traces, structure, now.judged().shapes(), first_guess(traces, Structure(structure.terms))
            )  # fmt: skip
            for name in (*gainless, *changing):
                seen = self._as_seen(screen, name, structure, now.values())
                if seen is not None and seen.squares < tried.get(name, best).squares:
                    out[name] = seen
        if min((w.level for w in out.values()), default=np.inf) < ENDS_NEAR:
            return out
        for name in (n for n in changing if n not in out):
            large = self._or_large(name, now, None, HOPELESS * best.estimate.sigma)
            if large is not None and large.squares < best.squares:
                out[name] = large
        return out

    def pairs(self, now: Whole) -> list[Pair]:
        """Two effects at once that may be worth a fit; none that follow anything, and no channels."""
        traces = [self.traces[i] for i in self.fit]
        names = [
            n for n in self.allowed
            if n not in now.structure.effects and not simplicity(n)
            and effects.get(n).place is not Place.SENSOR and not effects.get(n).resembles_much
        ]  # fmt: skip
        values = now.values()
        jck = (values.get(("inertia",), 1.0), values.get(("damping",), 0.0), values.get(("stiffness",), 0.0))
        start = replace(first_guess(traces, Structure(now.structure.terms)), platform=jck)
        return pairs(traces, now.structure, now.judged().shapes(), start, self._scale(now), names)

    def taken_on(self, fitted: Whole) -> Whole:
        """A fit that still goes down, taken on: a sharp resonance is found late, and then at once."""
        for _ in range(TAKEN_ON):
            if fitted.estimate.converged or fitted.at_noise:
                break
            further = self.whole(fitted.structure, fitted.values())
            if further is None or further.squares >= fitted.squares:
                break
            slow, fitted = further.squares > GOING * fitted.squares, further
            if slow:
                break
        return fitted

    def anew(self, fitted: Whole) -> Whole:
        """A fit that is done; far from the noise begun anew by way of a short horizon, for it may creep in a valley."""
        if fitted.level > STILL_FAR:
            other = self.by_way_of_a_short_horizon(fitted.structure, fitted.values())
            if other is not None and other.squares < fitted.squares:
                fitted = other
        return self.taken_on(fitted)

    def _looks(self, now: Whole, names: Sequence[str], in_full: bool = False) -> list[Scored]:
        """Scores of all candidates: of a long recording first on part of it, then on all for those that show there."""
        sigma, scale = self.noise * float(np.sqrt(now.level)), self._scale(now)
        if in_full or now.count < LONG:
            return Scores(now.estimate, self.fixed, sigma, scale).all(names)
        part = Scores(now.estimate, self.fixed, sigma, scale, LONG / now.count).all(names)
        if part and part[0].gain > PLAIN:
            return part
        shown = [s.effect for s in part if s.gain > SHOWN][:MOST_SHOWN]
        whole = Scores(now.estimate, self.fixed, sigma, scale).all(shown) if shown else []
        return whole + [s for s in part if s.effect not in shown]

    def _from(self, now: Whole, look: Scored, best: Whole) -> Whole | None:
        """A candidate fitted from where its score points, if need be by way of a short horizon.

        ``best`` is the best fit of the round so far. Over whole runs friction has false minima: a standstill that
        comes too soon puts the rest of the run off; over a short one the speed at which it drops has others, so what
        does not arrive by the one goes by the other. So has whatever moves the resonance: a start that is worse than
        the model without the candidate has lost it.
        """
        structure, hopeless = now.structure.plus(look.effect), HOPELESS * best.estimate.sigma
        traces, use = [self.traces[i] for i in self.fit], [self.split.fit[i] for i in self.fit]
        starts = [{**now.values(), **look.start}, {**now.values(), **look.besides, **look.start}]
        squares = [squares_at(traces, structure, start, use, self.finer) / self.noise**2 for start in starts]
        start = starts[int(np.argmin(squares))]
        friction, fitted = effects.get(look.effect).place is Place.FRICTION, None
        lost = min(squares) > now.squares or now.level > VERY_FAR
        if not lost:
            fitted = self.whole(structure, start, hopeless, FEW_STEPS)
        if lost or (friction and (fitted is None or fitted.level > AT_FLOOR)):
            near = self.by_way_of_a_short_horizon(structure, start, hopeless, FEW_STEPS)
            fitted = min((w for w in (fitted, near) if w is not None), key=lambda w: w.squares, default=None)
        return fitted if best.level < ENDS_NEAR else self._or_large(look.effect, now, fitted, hopeless)

    def _within(self, now: Whole, look: Scored, best: Whole) -> Whole | None:
        """The special case of what is at the noise, from its J, C, K: the richer one may have nothing of its own."""
        begin = {**now.values(), **{n: v for n, v in best.values().items() if n in now.values()}}
        fitted = self.whole(now.structure.plus(look.effect), {**begin, **look.start})
        return fitted if fitted is not None and fitted.at_noise else self._from(now, look, best)

    def by_way_of_a_short_horizon(
        self, structure: Structure, start: Mapping[Name, float], hopeless: float = np.inf, steps: int = STEPS
    ) -> Whole | None:
        """A structure fitted over whole runs, from where a short horizon leads: few starts are lost on that."""
        traces, use = [self.traces[i] for i in self.fit], [self.split.fit[i] for i in self.fit]
        near = refine(traces, structure, start, self.horizon, 8, use, fixed=self.fixed, coarse=True, tolerance=1e-3)
        if np.isfinite(near.sigma):
            start = dict(zip(near.names, near.values.tolist(), strict=True))
        return self.whole(structure, start, hopeless, steps)

    def _or_large(self, name: str, now: Whole, small: Whole | None, hopeless: float) -> Whole | None:
        """The same from where the effect is no small addition, while the fit is not near the noise."""
        effect, best, values = effects.get(name), small, now.values()
        if self.torque_free or len(now.structure.effects) > len(self.declared) + 1:
            return small  # a third effect that is no small addition would have come before
        jck = tuple(values.get((t,), 0.0) for t in TERMS)
        for large in effect.large_starts(jck, self._scale(now)) if effect.large_starts else ():  # type: ignore[arg-type]
            if best is not None and best.level < ENDS_NEAR:
                break
            start: dict[Name, float] = dict(values)
            start |= {(t,): v for t, v in large.terms.items()}
            start |= {(name, p): v for p, v in large.own.items()}
            other = self.by_way_of_a_short_horizon(now.structure.plus(name), start, hopeless)
            best = min((w for w in (best, other) if w is not None), key=lambda w: w.squares, default=None)
        return best

    def _scale(self, now: Whole) -> Scale:
        values, traces = now.values(), [self.traces[i] for i in self.fit]
        inertia, damping, stiffness = (values.get((t,), 0.0) for t in TERMS)
        natural_hz = float(np.sqrt(max(stiffness, 0.0) / max(inertia, 1e-300)) / (2.0 * np.pi))
        lines = foreign_lines_hz(traces, now.estimate.residuals(), self.noise, natural_hz)
        return scale_of(
            traces,
            (inertia, damping, stiffness),
            lines,
            ringing_hz(traces, natural_hz),
            rings_hz(traces, now.estimate.residuals(), natural_hz),
        )

    def _shortlist(self, looks: Sequence[Scored], now: Whole, most: int, faint: float) -> list[Scored]:
        """The largest gains beyond their penalty, and what comes first by order or simplicity."""
        penalty = float(np.log(max(now.count, 2)))
        hope = 0.5 if now.level < AT_FLOOR else 0.0  # there a score is nearly what a fit would bring
        worth = sorted(
            (s for s in looks if s.gain > max(WORTH_A_FIT, hope * (CHANCE + s.count * penalty))),
            key=lambda s: s.count * penalty - s.gain,
        )
        promising = worth
        worth = [s for s in worth if s.gain > faint * max(w.gain for w in worth)]
        gains = {s.effect: s.gain for s in worth}  # what contains another and promises less is not it
        worth = [s for s in worth if all(gains.get(n, 0.0) <= s.gain for n in effects.get(s.effect).nests)]
        short = [s for s in worth if not simplicity(s.effect)][:most]  # channels come beside, they displace nothing
        short = sorted(short + [s for s in worth if simplicity(s.effect)][:CHANNELS_TRIED], key=worth.index)
        wanted = {n for s in short for n in (*effects.get(s.effect).nests, *effects.get(s.effect).lower_order)}
        likes = [s for s in promising if _is_like(s.effect, [w.effect for w in short])]
        return short + [s for s in (*worth, *likes) if (s.effect in wanted or s in likes) and s not in short]


def _is_like(name: str, others: Iterable[str]) -> bool:
    """Whether it is the simpler of two effects that no record parts: scores favour the richer."""
    count = len(effects.get(name).parameters)
    return any(
        name in (effects.get(o).never_separable or {}) and count < len(effects.get(o).parameters) for o in others
    )


def _loads_differ(traces: Sequence[Trace]) -> bool:
    """Whether a known inertia was mounted for some of the runs."""
    return len({t.run.added_inertia_kg_m2 for t in traces}) > 1
