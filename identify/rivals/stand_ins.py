"""Named effects that may only take up what something else leaves, and how far J, C and K hang on them.

A few effects follow almost anything: a second mass on a spring answers an amplifier's coarse steps, a torque that
repeats over the angle a cable that pulls at one place. As long as nothing is left over, the evidence speaks for them.
Where something is left that no effect describes, nobody knows how much of it they have taken up, nor what they did to
J, C and K in its place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.select.field_search import Found
from identify.select.free_form_residual import MOVED_SIGMAS
from identify.wording import plain
from rig import effects
from rig.platform import TERMS


def with_stand_ins(found: Found, say: Callable[[str], None]) -> Found:
    """The same, with how far J, C and K move without each flexible effect; unchanged where nothing is left over."""
    flexible = [name for name in found.named if effects.get(name).is_flexible]
    if not flexible or not found.disturbance.depends_on:
        return found
    say(f"something is left over: checking how far the parameters depend on {', '.join(map(plain, flexible))}")
    hangs_on = {effects.first_of(name): moved(found.after, found.lacking(name)[0]) for name in flexible}
    return replace(found, disturbance=replace(found.disturbance, moves_without_percent=hangs_on))


def moved(final: FinalFit, less: FinalFit) -> dict[str, float]:
    """By how much J, C and K differ between two fits, percent, where that is more than the fits are uncertain."""
    out: dict[str, float] = {}
    for term in TERMS:
        name = (term,)
        here, there = final.values.get(name), less.values.get(name)
        if not here or there is None or name not in final.names:
            continue
        errors = [e for e in (final.std_error(name), less.std_error(name)) if np.isfinite(e)]
        if abs(there - here) > MOVED_SIGMAS * float(np.linalg.norm(errors)):
            out[term] = 100.0 * abs(there - here) / abs(here)
    return out
