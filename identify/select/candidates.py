"""What may be added to a model that runs free: scored, fitted on top of it over whole runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.cross_validation import Judged
from identify.estimate.initial_guess import first_guess
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.propose.pairs import Pair, pairs
from identify.propose.score_test import Scored, Scores
from identify.propose.screening import Screen
from identify.runs.holdout import Split
from identify.runs.measured_channels import simplicity
from identify.runs.observability import why_unseen
from identify.select.criterion import STILL_FAR
from identify.select.fitter import WORTH_A_FIT, Fits
from identify.select.free_run_fit import AT_FLOOR, CHANCE, ENDS_NEAR, NEAR_THEN, TWICE, Whole
from identify.signals.trace import Trace, loads_differ
from rig import effects
from rig.effects.base import Place

TRIED = 4  # candidates of a round that are fitted
CHANNELS_TRIED = 2  # effects of measured channels, beside them
SHOWN = 6.0  # fall of chi square on that part at which the whole is looked at
MOST_SHOWN = 10
PLAIN = 300.0  # fall of chi square on that part at which it tells enough
LONG = 14_000  # samples; of a longer recording a first part is scored first
FEW_STEPS = 8  # of a fit that is only compared
FAR_BEHIND = 0.7  # of the best score: not fitted any more once another candidate is at the floor
FINER, SHARPER = 3, 2  # times the steps, and how often they are made finer
FAINT = 0.03  # of the best score: what promises so little beside another is not what the round is about
VERY_FAR = 1e4  # mean square over the noise's variance: there whole runs have false minima on the way down
MOST_OF_IT = 0.2  # of the squares: a candidate that leaves less is there, whatever else is missing
LIGHT = 0.01  # damping ratio of a start whose damping would be negative
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
        self.fits = Fits(traces, split, len(declared) + 1)
        self.allowed = [n for n in allowed if self._possible(n)]

    def _possible(self, name: str) -> bool:
        if effects.get(name).needs_added_inertia and not loads_differ(self.fits.traces):
            return False
        return not why_unseen(name, self.fits.traces)

    def tried(self, now: Whole, most: int = TRIED, in_full: bool = False) -> tuple[dict[str, Whole], list[Scored]]:
        """The most promising candidates, fitted on top of a model, and all that were looked at.

        ``in_full`` scores on all samples at once: what a decay tells is in how it ends.
        """
        looks = self._looks(now, [n for n in self.allowed if n not in now.structure.effects], in_full)
        tried: dict[str, Whole] = {}
        short = self._shortlist(looks, now, most, 0.0 if in_full else FAINT)  # far off a decay's scores point anywhere
        for look in sorted(short, key=lambda s: -s.gain):  # where that is the one, the others need no fit
            best = min(tried.values(), key=lambda w: w.squares, default=now)
            if self.fits.gives_up(best):
                return tried, looks
            found = best.structure.effects[-1] if best is not now and best.at_noise else None
            holds_it = found is not None and look.effect in effects.get(found).nests
            behind = look.gain < FAR_BEHIND * short[0].gain and not _is_like(look.effect, tried)
            if best.at_noise and behind and not holds_it:
                continue
            fitted = self._within(now, look, best) if holds_it else self._from(now, look, best)
            if fitted is not None:
                tried[look.effect] = fitted
        best = min(tried.values(), key=lambda w: w.squares, default=now)
        if best.level > ENDS_NEAR and best.squares > MOST_OF_IT * now.squares:
            tried |= self._seen_otherwise(now, tried, best)
            best = min(tried.values(), key=lambda w: w.squares, default=now)
        if self.fits.gives_up(best):
            return tried, looks
        pliant = best is not now and effects.get(best.structure.effects[-1]).resembles_much
        for name, w in list(tried.items()):
            plain = not effects.get(name).resembles_much
            falls = w.squares < now.squares  # what does not is in a wrong place, and no further steps mend that
            near = w.squares < NEAR_THEN * best.squares or (pliant and plain and falls)
            simpler = [tried[n] for n in effects.get(name).nests if n in tried]
            chosen_anyway = w.estimate.converged and any(n.squares < TWICE * w.squares for n in simpler)
            found_already = best.at_noise or (not plain and any(t.at_noise for t in tried.values()))
            if near and not found_already and not chosen_anyway:
                tried[name] = self.fits.elsewhere(self.fits.taken_on(w) if falls else w, name)
        tried = self._sharp({n: w for n, w in tried.items() if not w.at_noise}, tried)
        return {n: self.fits.settled(w) for n, w in tried.items()}, looks

    def sharp(self, now: Whole) -> Whole:
        """A model near the noise, simulated as finely as it takes for its error not to be the simulation's."""
        return self._sharp({"": now}, {"": now})[""]

    def _sharp(self, asked: dict[str, Whole], tried: dict[str, Whole]) -> dict[str, Whole]:
        """What would be nearer the noise in finer steps is fitted with finer ones, and all that follows is.

        Beside a quiet gyro the error of a coarse simulation is thousands of chi square, which anything takes away.
        """
        near = {n: w for n, w in asked.items() if w.level < ENDS_NEAR}
        for _ in range(SHARPER):
            finer = FINER * self.fits.finer
            if not any(w.squares - self.fits.squares(w.structure, w.values(), finer) > CHANCE for w in near.values()):
                break
            self.fits.finer = finer
            fitted = {n: self.fits.whole(w.structure, w.values()) for n, w in near.items()}
            tried = tried | {n: w for n, w in fitted.items() if w is not None}
            near = {n: tried[n] for n in near}
        return tried

    def large(self, found: Judged) -> Whole | None:
        """With an effect that is no small addition, begun where the regression along the measured motion sees it.

        A second inertia as heavy as the first has two resonances: no model with one of them runs near the data.
        """
        traces, structure = self.fits.fitting, found.structure
        best: Whole | None = None
        for name in self.allowed:
            if effects.get(name).large_starts is None or name in structure.effects:
                continue
            screen = Screen(traces, structure, found.shapes(), first_guess(traces, Structure(structure.terms)))
            fitted = self.fits.as_seen(screen, name, structure, found.values())
            if fitted is not None and (best is None or fitted.squares < best.squares):
                best = self.fits.taken_on(fitted)
        return best

    def _seen_otherwise(self, now: Whole, tried: Mapping[str, Whole], best: Whole) -> dict[str, Whole]:
        """What no score along a motion that is far off shows, as the regression along the measured motion sees it.

        A drive that saturates at half its torque is scored best where it hardly does, if its motion is far off; a light
        mode near a tone of the torque hides behind all that follows the resonance. Last come the large starts.
        """
        out: dict[str, Whole] = {}
        structure, far = now.structure, best.level > STILL_FAR
        untried = [n for n in self.allowed if n not in tried and n not in structure.effects]
        changing = [n for n in (*tried, *(untried if far else ())) if effects.get(n).large_starts is not None]
        gainless = [n for n in tried if not any(p.linear for p in effects.get(n).parameters)]
        seen_by_regression = [*gainless, *(n for n in changing if n not in gainless)] if far else []
        if seen_by_regression and not self.fits.torque_free:
            start = first_guess(self.fits.fitting, Structure(structure.terms))
            screen = Screen(self.fits.fitting, structure, now.judged().shapes(), start)
            for name in seen_by_regression:
                if self.fits.gives_up(best):
                    break
                seen = self.fits.as_seen(screen, name, structure, now.values(), best.estimate.sigma)
                if seen is not None and seen.squares < tried.get(name, best).squares:
                    out[name] = seen
        for name in changing:
            if min((w.level for w in out.values()), default=np.inf) < ENDS_NEAR or self.fits.gives_up(best):
                break
            small = out.get(name, tried.get(name))
            large = self.fits.or_large(name, now, small, best.estimate.sigma)
            if large is not None and large is not small and (name in tried or large.squares < best.squares):
                out[name] = large
        return out

    def pairs(self, now: Whole) -> list[Pair]:
        """Two effects at once that may be worth a fit; no channels, and none that has a shape for all."""
        traces, structure, shapes = self.fits.fitting, now.structure, now.judged().shapes()
        names = [
            n for n in self.allowed
            if n not in structure.effects and not simplicity(n) and not effects.get(n).sought_alone
            and effects.get(n).place is not Place.SENSOR
        ]  # fmt: skip
        values = now.values()
        jck = (values.get(("inertia",), 1.0), values.get(("damping",), 0.0), values.get(("stiffness",), 0.0))
        start = first_guess(traces, Structure(structure.terms))
        screen = Screen(traces, structure, shapes, start)

        def best_shape(name: str) -> tuple[float, ...] | None:
            look = screen.look(name)
            return None if look is None else look.shapes[name]

        scale = self.fits.scale(now)
        lines = (scale.ringing_hz,) if scale.ringing_hz > 0.0 else ()  # where a tone may pass for the resonance
        scale = replace(scale, lines_hz=(*lines, *scale.lines_hz))
        return pairs(traces, structure, shapes, replace(start, platform=jck), scale, names, best_shape)

    def _looks(self, now: Whole, names: Sequence[str], in_full: bool = False) -> list[Scored]:
        """Scores of all candidates: of a long recording first on part of it, then on all for those that show there."""
        sigma, scale = self.fits.noise * float(np.sqrt(now.level)), self.fits.scale(now)
        if in_full or now.count < LONG:
            return Scores(now.estimate, self.fits.fixed, sigma, scale).all(names)
        part = Scores(now.estimate, self.fits.fixed, sigma, scale, LONG / now.count).all(names)
        if part and part[0].gain > PLAIN:
            return part
        shown = [s.effect for s in part if s.gain > SHOWN][:MOST_SHOWN]
        whole = Scores(now.estimate, self.fits.fixed, sigma, scale).all(shown) if shown else []
        return whole + [s for s in part if s.effect not in shown]

    def _from(self, now: Whole, look: Scored, best: Whole) -> Whole | None:
        """A candidate fitted from where its score points, if need be by way of a short horizon.

        ``best`` is the best fit of the round so far. Over whole runs friction has false minima: a standstill that
        comes too soon puts the rest of the run off; over a short one the speed at which it drops has others, so what
        does not arrive by the one goes by the other. So has whatever moves the resonance: a start that is worse than
        the model without the candidate has lost it.
        """
        structure, hopeless = now.structure.plus(look.effect), HOPELESS * best.estimate.sigma
        starts = [{**now.values(), **look.start}, _damped({**now.values(), **look.besides, **look.start}, now)]
        squares = [self.fits.squares(structure, start) for start in starts]
        start = starts[int(np.argmin(squares))]
        friction, fitted = effects.get(look.effect).place is Place.FRICTION, None
        lost = min(squares) > now.squares or now.level > VERY_FAR
        if not lost:
            fitted = self.fits.whole(structure, start, hopeless, FEW_STEPS)
        if lost or (friction and (fitted is None or fitted.level > AT_FLOOR)):
            near = self.fits.by_way_of_a_short_horizon(structure, start, hopeless, FEW_STEPS)
            fitted = min((w for w in (fitted, near) if w is not None), key=lambda w: w.squares, default=None)
        return fitted

    def _within(self, now: Whole, look: Scored, best: Whole) -> Whole | None:
        """The special case of what is at the noise, from its J, C, K: the richer one may have nothing of its own."""
        begin = {**now.values(), **{n: v for n, v in best.values().items() if n in now.values()}}
        fitted = self.fits.whole(now.structure.plus(look.effect), {**begin, **look.start})
        return fitted if fitted is not None and fitted.at_noise else self._from(now, look, best)

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
        special = looks if now.level > VERY_FAR else worth  # there the score of a special case points anywhere, too
        besides = [s for s in special if s.effect in wanted] + likes
        besides += [s for s in looks if effects.get(s.effect).needs_added_inertia]  # the known mass was mounted for it
        return short + [s for i, s in enumerate(besides) if s not in (*short, *besides[:i])]


def _damped(start: dict[Name, float], now: Whole) -> dict[Name, float]:
    """A start whose damping is not negative unless the model's is: from growing motion no fit finds its way back.

    A lag takes from the damping what it had stood for, and the tangent at none takes a little too much.
    """
    name = ("damping",)
    if start.get(name, 0.0) >= 0.0 or now.values()[name] < 0.0:
        return start
    inertia, stiffness = start.get(("inertia",), 0.0), start.get(("stiffness",), 0.0)
    return {**start, name: 2.0 * LIGHT * float(np.sqrt(max(inertia * stiffness, 0.0)))}


def _is_like(name: str, others: Iterable[str]) -> bool:
    """Whether it is the simpler of two effects that no record parts: scores favour the richer."""
    count = len(effects.get(name).parameters)
    return any(
        name in (effects.get(o).never_separable or {}) and count < len(effects.get(o).parameters) for o in others
    )
