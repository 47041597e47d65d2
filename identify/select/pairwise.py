"""Two effects fitted at once: of two large ones each hides how much the other takes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from identify.select.candidates import FEW_STEPS, Candidates
from identify.select.criterion import AT_NOISE
from identify.select.free_run_fit import ENDS_NEAR, Whole
from rig import effects

TOOK, LARGE = 0.9, 3  # of the squares that a candidate has to leave at most to be tried with another, and how many
HALF_OF_IT = 0.5  # of the squares that a pair has to take in a few steps to be taken on
NEARLY_ALL = 0.02  # of the squares that two effects may leave together where they do not come near the noise


def two_at_once(offer: Candidates, now: Whole, first_tried: Mapping[str, Whole]) -> list[Whole]:
    """Models with two more effects that no search for one at a time finds, and that come near the data; best first.

    Parameters
    ----------
    now
        The model that they are fitted on top of.
    first_tried
        What was fitted one at a time on top of it, by name.
    """
    near = [w for w in _as_seen(offer, now) if _brought_near(w, now)]
    near = near or [w for w in _both_large(offer, now, first_tried) if _brought_near(w, now)]
    return sorted(near, key=lambda w: w.squares)


def can_follow_anything(model: Whole) -> bool:
    """Whether one of the two can: such a pair counts at the noise only."""
    return any(effects.get(e).resembles_much for e in model.structure.effects[-2:])


def _brought_near(pair: Whole, now: Whole) -> bool:
    """Whether a pair is near the noise, or leaves so little that one of it may only be mistaken for its like."""
    return pair.level < ENDS_NEAR or pair.squares < NEARLY_ALL * now.squares


def _as_seen(offer: Candidates, now: Whole) -> list[Whole]:
    """Pairs fitted from where the regression along the measured motion sees them, until one comes near."""
    out: list[Whole] = []
    for pair in offer.pairs(now):
        if offer.fits.gives_up(now):
            break
        structure = now.structure.plus(pair.names[0]).plus(pair.names[1])
        own = {n: v for n, v in pair.start.items() if len(n) > 1}  # with J, C, K of the model, or of the regression
        starts = ({**now.values(), **own}, {**now.values(), **pair.start})
        squares = [offer.fits.squares(structure, start) for start in starts]
        start = starts[int(np.argmin(np.nan_to_num(squares, nan=np.inf)))]
        fitted = offer.fits.by_way_of_a_short_horizon(structure, start, now.estimate.sigma, FEW_STEPS)
        if fitted is None:
            continue
        fitted = _taken_on(offer, fitted, now)
        out.append(fitted)
        if fitted.level < (AT_NOISE if can_follow_anything(fitted) else ENDS_NEAR):
            break
    return out


def _both_large(offer: Candidates, now: Whole, first_tried: Mapping[str, Whole]) -> list[Whole]:
    """The candidates of the first round that took the most, two at a time."""
    took = {n: w for n, w in first_tried.items() if w.squares < TOOK * now.squares}
    travel_deg = max(t.travel_deg for t in offer.fits.traces)
    out: list[Whole] = []
    for a, b in combinations(sorted(took, key=lambda n: took[n].squares)[:LARGE], 2):
        if effects.get(a).alike(b, travel_deg) or b in effects.get(a).nests or a in effects.get(b).nests:
            continue
        structure = now.structure.plus(a).plus(b)
        for first, second in ((a, b), (b, a)):  # J, C and K of either
            own = {k: v for k, v in took[second].values().items() if k[0] == second}
            both = offer.fits.whole(structure, {**took[first].values(), **own})
            if both is None:
                continue
            out.append(_taken_on(offer, both, now))
            if out[-1].level < (AT_NOISE if can_follow_anything(both) else ENDS_NEAR):
                return out
    return out


def _taken_on(offer: Candidates, pair: Whole, now: Whole) -> Whole:
    """A pair fitted to the end, where its first steps promise anything."""
    return offer.fits.taken_on(pair) if pair.squares < HALF_OF_IT * now.squares else pair
