"""Which of several models fitted over whole runs is believed: likelihood, what a simpler one does as well, evidence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.runs.measured_channels import simplicity
from identify.select.free_run_fit import AT_FLOOR, CHANCE, ENDS_NEAR, TWICE, Whole
from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS

EQUAL = 4.0  # fall of chi square that says nothing: the library's order, simple before special, decides
RIVAL = 10.0  # what parts two candidates for good
HELD = 4.0  # fall of chi square on the held-out samples that no chance makes
STRONG = 4.0  # standard errors by which every parameter of a new effect must differ from zero
SHARE = 0.2  # of the excess over the noise that an effect has to take away
CLEARLY_LEFT = 5.0  # standard deviations of chi square
AT_NOISE = 1.05  # mean square over the noise's variance: the noise is known to a percent or two
STILL_FAR = 100.0  # mean square over the noise's variance
THRICE = 3.0  # times the excess over the noise: what follows anything takes that much of what else is missing
AS_FAR = 1.03  # times the squares of the best while the noise is still far: the simpler is as good


def chosen_of(tried: Mapping[str, Whole], now: Whole) -> str | None:
    """The candidate to add: the likeliest, or the simplest of those that are as likely."""
    good = {n: w for n, w in tried.items() if worth(n, w, now)}
    if not good:
        return None
    best = simplest(good)
    for first in effects.get(best).lower_order:
        if first in good:
            return first
    return best


def simplest(good: Mapping[str, Whole]) -> str:
    """The likeliest, or the simplest of those that are as likely."""
    best = min(good, key=lambda n: good[n].penalised)
    # The richer one may only soak up what is still missing.
    nested = [n for n in effects.get(best).nests if n in good and _as_near(good[n], good[best])]
    if nested:
        return min(nested, key=lambda n: good[n].squares)
    behind = {n: (good[n].penalised - good[best].penalised) / good[best].level for n in good}
    alike = [n for n in good if behind[n] < RIVAL or _as_far(n, good[n], best, good[best])]
    return min(alike, key=lambda n: (*_simplicity(n), behind[n] > EQUAL, effects.known().index(n)))


def _as_far(name: str, model: Whole, best: str, nearest: Whole) -> bool:
    """Whether a model is as good as the nearest where what is left is no chance.

    The nearest then only takes what else is missing, and what can follow anything takes much of that.
    """
    if effects.get(best).resembles_much and not effects.get(name).resembles_much and nearest.level > AT_NOISE:
        missing = max(nearest.squares - nearest.count, 0.0)
        if model.squares < TWICE * nearest.squares and model.squares - model.count < THRICE * missing:
            return True
    return nearest.level > STILL_FAR and model.squares < AS_FAR * nearest.squares


def worth(name: str, new: Whole, now: Whole) -> bool:
    """Whether chi square falls beyond chance, also where nothing was fitted, with parameters that stand out."""
    follows = name not in TERMS and effects.get(name).resembles_much  # a term that was set aside is asked, too
    if follows and now.level < ENDS_NEAR and new.level > AT_NOISE:
        return False  # near the noise it follows a few disturbed moments as gladly as anything
    fall, held = (now.penalised - new.penalised) / new.level, (now.held - new.held) / new.level
    excess = now.squares - now.count
    large = excess > CLEARLY_LEFT * np.sqrt(2.0 * now.count)
    enough = not large or now.squares - new.squares > SHARE * excess
    return fall > CHANCE and held > HELD and enough and new.judged().strength(name) > STRONG


def _as_near(simple: Whole, rich: Whole) -> bool:
    """Whether a special case leaves at most twice as much, where something is left that noise does not explain."""
    if rich.level > AT_FLOOR:
        return simple.squares < TWICE * rich.squares
    excess, chance = rich.squares - rich.count, CLEARLY_LEFT * float(np.sqrt(2.0 * rich.count))
    return excess > chance and simple.squares - simple.count < TWICE * excess


def _simplicity(name: str) -> tuple[int, int, bool]:
    """What goes first among candidates that do as well: no channel, fewer parameters, the drive before the sensor."""
    effect = effects.get(name)
    return simplicity(name), len(effect.parameters), effect.place is Place.SENSOR
