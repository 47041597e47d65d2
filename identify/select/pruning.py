"""Terms and effects that a finished model does as well without, and declared terms that it misses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from identify.model.parameters import Name
from identify.select.criterion import RIVAL, STILL_FAR, worth
from identify.select.fitter import Fits
from identify.select.free_run_fit import Whole
from identify.select.search_state import Search
from rig import effects
from rig.platform import TERMS

CERTAIN = 30.0  # standard errors beyond which nobody asks whether a term is needed


class Pruning:
    """Asks of each part of a model whether the data need it."""

    def __init__(self, fits: Fits, say: Callable[[str], None]) -> None:
        self.fits, self.say = fits, say

    def pruned(self, found: Search, now: Whole, names: Sequence[str]) -> Whole:
        """Without every term or effect that the data do as well without."""
        travel_deg = max(t.travel_deg for t in self.fits.traces)
        for name in names:
            kept_by = [e for e in now.structure.effects if name in effects.get(e).lower_order]
            last = len(now.structure.terms) - len(self.fits.fixed) + len(now.structure.effects) <= 1
            if name == "inertia" or kept_by or last:
                continue
            tied = _tied(name, now, travel_deg)
            start = {n: v for n, v in now.values().items() if n[0] != name}
            wider = [e for e in now.structure.effects if name in effects.get(e).nests]
            if wider:
                start = _taken_in(start, now.values(), name, wider[0])
            elif now.judged().strength(name) > CERTAIN and not (_own_in_each_run(name) or tied):
                continue
            without = None if tied else self.fits.whole(now.structure.minus(name), start)
            if without is None or (now.level > STILL_FAR and without.squares > now.squares):
                fits = (without, self._left(now, name, start, found.base.values()))
                without = min((w for w in fits if w is not None), key=lambda w: w.squares, default=None)
            if without is None or without.penalised - now.penalised > RIVAL * now.level:
                continue
            reason = f"free-run error {now.estimate.sigma:.4g} with it, {without.estimate.sigma:.4g} without it"
            found.dropped.append((name, reason))
            found.rivals.pop(name, None)
            self.say(f"dropped {name}: {reason}")
            now = without
        return now

    def _left(self, now: Whole, name: str, start: Mapping[Name, float], base: Mapping[Name, float]) -> Whole | None:
        """The model without an effect, anew: where no record parts two, or what is left begins in a wrong place.

        J, C and K may lie anywhere then, or near where they began.
        """
        before: dict[Name, float] = {n: v for n, v in base.items() if len(n) == 1 and n in start}
        starts = (start, {**start, **before})
        fits = [self.fits.by_way_of_a_short_horizon(now.structure.minus(name), s) for s in starts]
        return min((w for w in fits if w is not None), key=lambda w: w.squares, default=None)

    def restored(self, found: Search, now: Whole, terms: Sequence[str]) -> Whole:
        """With a declared term that was set aside, where it is missed now that the effects are there."""
        for name in terms:
            if name in now.structure.terms:
                continue
            structure = replace(now.structure, terms=tuple(t for t in TERMS if t in (*now.structure.terms, name)))
            fuller = self.fits.whole(structure, {**now.values(), (name,): 0.0})
            if fuller is not None and worth(name, fuller, now):
                found.dropped[:] = [d for d in found.dropped if d[0] != name]
                self.say(f"restored {name}: free-run error {now.estimate.sigma:.4g} -> {fuller.estimate.sigma:.4g}")
                now = fuller
        return now


def _taken_in(start: Mapping[Name, float], values: Mapping[Name, float], name: str, wider: str) -> dict[Name, float]:
    """Start values where an effect that contains another takes its gain over."""
    gain = next((values[(name, p.name)] for p in effects.get(name).parameters if p.linear), 0.0)
    linear = {p.name for p in effects.get(wider).parameters if p.linear}
    return {n: v + gain if n[0] == wider and n[1] in linear else v for n, v in start.items()}


def _tied(name: str, now: Whole, travel_deg: float) -> bool:
    """Whether the model has both of two effects that this record cannot part: their errors say nothing then."""
    others = [e for e in now.structure.effects if e != name and name not in TERMS]
    return any(effects.get(name).alike(e, travel_deg) or effects.get(e).alike(name, travel_deg) for e in others)


def _own_in_each_run(name: str) -> bool:
    """Whether an effect has gains of its own in every run, with which it soaks up much."""
    return name not in TERMS and any(p.per_run for p in effects.get(name).parameters)
