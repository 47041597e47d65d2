"""Named effects that may only take up what something else leaves, and how far J, C and K hang on them.

A few effects follow almost anything: a second mass on a spring answers an amplifier's coarse steps, a torque that
repeats over the angle a cable that pulls at one place. As long as nothing is left over, the evidence speaks for them,
unless samples that were held out are explained as well without. Where something is left that no effect describes,
nobody knows how much of it they have taken up, nor what they did to J, C and K in its place. Where that is little
beside what an effect takes, the effect is no stand-in for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.runs.observability import is_seen_to_repeat
from identify.select.evidence import WEIGHT
from identify.select.field_search import Found
from identify.select.free_form_residual import MOVED_SIGMAS
from identify.signals.trace import Trace
from identify.wording import joined, plain, quantity_of
from rig import effects
from rig.platform import TERMS


def with_stand_ins(found: Found, traces: Sequence[Trace], axis: str, say: Callable[[str], None]) -> Found:
    """The same without the flexible effects that something else is left beside; unchanged where nothing is left over.

    A residual that depends on what more of the same kind would depend on (other orders of cogging: the angle) does not
    speak against the name, unless it is a wave that is not seen to repeat. Then only how far J, C and K move without
    the effect is noted.
    """
    depends = found.disturbance.depends_on  # the largest first
    if not depends:
        return _with_unproven(found)
    flexible = [name for name in found.named if effects.get(name).is_flexible]
    apart = {name: found.without(name) for name in flexible}
    flexible = [name for name in flexible if _is_in_doubt(found, apart[name])]
    if not flexible:
        return found
    waves = {
        name: is_seen_to_repeat(effects.first_of(name), found.named, found.after.values, traces) for name in flexible
    }
    stand_ins = [name for name in flexible if depends[0].on not in effects.get(name).goes_with or not waves[name]]
    if stand_ins:
        found = _taken_back(found, stand_ins, axis)
        say(f"not named: {_listed(stand_ins)}; what is left then still depends on the {depends[0].on}")
        flexible = [name for name in flexible if name not in stand_ins]
    if not flexible:
        return found
    say(f"something is left over: checking how far the parameters depend on {_listed(flexible)}")
    moves = dict(found.disturbance.moves_without_percent)
    for name in flexible:
        less = found.without(name) if stand_ins else apart[name]
        moves[effects.first_of(name)] = moved(found.after, less.after)
    return replace(found, disturbance=replace(found.disturbance, moves_without_percent=moves))


def _with_unproven(found: Found) -> Found:
    """The same with how far J, C and K move without a flexible effect that does nothing for samples that were held out.

    The name is kept, for its evidence lies elsewhere (a mode beyond what was excited shows as the inertia it takes).
    """
    gained = found.search.contribution
    unproven = [n for n in found.named if effects.get(n).is_flexible and gained.get(n, np.inf) <= 1.0]
    if not unproven:
        return found
    moves = {effects.first_of(name): moved(found.after, found.without(name).after) for name in unproven}
    return replace(found, disturbance=replace(found.disturbance, moves_without_percent=moves))


def _is_in_doubt(found: Found, less: Found) -> bool:
    """Whether what is left over is a share of what an effect takes that would be a name of its own."""
    with_it, without = found.in_torque[1].held_relative, less.in_torque[1].held_relative
    return bool(found.disturbance.depends_on[0].relative ** 2 > WEIGHT * (without**2 - with_it**2))


def _taken_back(found: Found, names: Sequence[str], axis: str) -> Found:
    """The same without effects that may only stand in.

    What they had taken up may be torque of an effect that does not follow almost anything: that is added. Where there
    is none, what was left beside them is left without them, too. One of them may be real all the same: J, C and K are
    no surer than they differ with and without.
    """
    depends = found.disturbance.depends_on
    less = found.without(*names, others=True)
    left = less.disturbance
    for dependence in depends if set(less.named) < set(found.named) else ():
        left = left.with_free_form(dependence, {})
    search = less.search
    words = (
        f"Not named: {_listed(names)}. This would explain part of what is missing, but can follow almost any torque, "
        f"and with it the residual still depends on the {quantity_of(depends[0], axis)}."
    )
    search.drop(less.kept, "left open")
    search.left_open = f"{search.left_open} {words}".strip()
    if not less.named:  # the declared model has all of its terms
        search.dropped = []
    apart = {" and ".join(dict.fromkeys(effects.first_of(n) for n in names)): moved(less.after, found.after)}
    return replace(less, disturbance=replace(left, moves_without_percent=apart))


def _listed(names: Sequence[str]) -> str:
    return joined(list(dict.fromkeys(plain(effects.first_of(name)) for name in names)))


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
