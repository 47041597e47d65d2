"""One effect in the place of two that together do what it does: gravity off the axis is an offset and a bent spring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations

from identify.model.parameters import Name
from identify.select.candidates import Candidates
from identify.select.criterion import RIVAL
from identify.select.free_run_fit import Whole
from identify.select.search_state import Search
from rig import effects

FAR_WORSE = 100.0  # fall of chi square by which the twin is the worse one


def one_for_two(offer: Candidates, found: Search, now: Whole, say: Callable[[str], None]) -> Whole:
    """The model with the twin of a named effect in the place of that and of another, where the data do as well with it.

    Only twins that no record within the travel parts from the named effect are asked: they were never tried beside
    what had been named before them.
    """
    added = now.structure.effects[len(found.base.structure.effects) :]
    travel_deg = max(t.travel_deg for t in offer.fits.traces)
    for name, other in permutations(added, 2):
        for twin in effects.get(name).never_separable or {}:
            if (
                twin not in offer.allowed
                or twin in now.structure.effects
                or not effects.get(name).alike(twin, travel_deg)
            ):
                continue
            start: dict[Name, float] = {n: v for n, v in now.values().items() if n[0] != name}
            start |= {(twin, p.name): 0.0 for p in effects.get(twin).parameters if p.linear}
            if any((twin, p.name) not in start for p in effects.get(twin).parameters):
                continue  # a shape of which nobody knows where to begin
            swapped = replace(now.structure, effects=tuple(twin if e == name else e for e in now.structure.effects))
            both = offer.fits.whole(swapped, start)  # beside the other one first: at once it finds no way
            if both is None or both.penalised > now.penalised + FAR_WORSE * now.level:
                continue
            alone = offer.fits.whole(swapped.minus(other), {n: v for n, v in both.values().items() if n[0] != other})
            if alone is None or alone.penalised > now.penalised + RIVAL * now.level:
                continue
            say(f"{twin} replaces {name} and {other}: it explains what both explain")
            for gone in (name, other):
                found.rivals.pop(gone, None)
                found.rival_models.pop(gone, None)
            found.rivals[twin] = ()
            return alone
    return now
