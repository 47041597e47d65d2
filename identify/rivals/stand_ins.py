"""Named effects that may only take up what something else leaves, and how far J, C and K hang on them.

Any effect takes a part of what another one leaves: a spring that stiffens of a drive that sags, a second mass on a
spring of an amplifier's coarse steps. As long as nothing is left over, the evidence speaks for it, unless it follows
almost anything and samples that were held out are explained as well without. Where something is left that no effect
describes, nobody knows how much of it a name has taken up, nor what that did to J, C and K. Where that is little beside
what an effect takes, the effect is no stand-in for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.residual import Dependence
from identify.runs.observability import is_seen_to_repeat
from identify.select.curve_rivals import CURVES
from identify.select.evidence import WEIGHT
from identify.select.free_form_residual import MOVED_SIGMAS, ON
from identify.select.search_state import Found
from identify.signals.trace import Trace
from identify.wording import contributes, joined, number, plain, quantity_of
from rig import effects
from rig.effects.base import Effect, Place
from rig.platform import TERMS

# Of the torque, that is left: then what goes with that is looked for, however freely it follows.
MOSTLY_LEFT_SHARE = 0.5
MORE = 0.5  # of what an effect takes, that is left: with more it does not help that it is needed, too
# Of what an effect takes, that it takes beside a curve too, and is no stand-in for that.
MIN_SHARE_KEPT_BESIDE_CURVE = 0.1


def with_stand_ins(found: Found, traces: Sequence[Trace], axis: str, say: Callable[[str], None]) -> Found:
    """The same without the effects that too much else is left beside; unchanged where nothing is left over.

    Of flexible ones, a residual that depends on what more of the same kind would depend on (other orders of cogging:
    the angle) does not speak against the name, unless it is a wave that is not seen to repeat. Then only how far J, C
    and K move without the effect is noted.
    """
    if not found.disturbance.depends_on:
        return _with_unproven(found)
    left_beside: list[Dependence] = []
    while stand_ins := _first([n for n in _in_doubt(found, traces) if _may_stand_in(n, found, traces)], found):
        depends = found.disturbance.depends_on
        less = _taken_back(found, stand_ins, axis)
        say(f"not named: {_listed(stand_ins)}; what is left then still depends on the {quantity_of(depends[0], axis)}")
        if less.in_torque[1].held_relative >= found.in_torque[1].held_relative:
            left_beside += depends
            if not set(less.named) <= set(found.named):  # others in their place, which nobody has asked about it yet
                less = _with_left(less, depends)
        found = less
    found = _with_left(found, left_beside)
    flexible = _in_doubt(found, traces)
    if not flexible:
        return found
    say(f"something is left over: checking how far the parameters depend on {_listed(flexible)}")
    moves = dict(found.disturbance.moves_without_percent)
    for name in flexible:
        moves[effects.first_of(name)] = moved(found.after, found.without(name).after)
    return replace(found, disturbance=replace(found.disturbance, moves_without_percent=moves))


def _with_left(found: Found, depends: Sequence[Dependence]) -> Found:
    """The same with what a model has left that left less: it is left without some of that, too, even if not seen."""
    disturbance = found.disturbance
    for dependence in depends:
        disturbance = disturbance.with_free_form(dependence, {})
    return replace(found, disturbance=disturbance) if depends else found


def _in_doubt(found: Found, traces: Sequence[Trace]) -> list[str]:
    """Effects beside which so much is left over as a share of what they take that it would be a name of its own.

    A lag is not asked: it takes little torque and is known all the same, by when the platform answers. What bends the
    torque of the drive (a dead zone) is. Nor is a constant torque: what is left has none. Of a wave over the angle that
    is not seen to repeat, whatever else goes with the angle is too much: only its fit tells it from any other curve.
    """
    depends = found.disturbance.depends_on  # the largest first
    asked = [n for n in found.named if not _is_bound(effects.get(n))] if depends else []
    return [
        name for name in asked
        if (depends[0].relative ** 2 > WEIGHT * found.taken_by(name) and not _is_needed_beside(name, found))
        or _is_one_of_many_curves(name, found, traces)
        or _follows_one_of_its_kind(name, found)
    ]  # fmt: skip


def _is_needed_beside(name: str, found: Found) -> bool:
    """Whether an effect takes something beside a free-form term of what is left, too: it does not stand for that.

    One that can follow almost any torque is not asked, unless it is a wave over the angle: that has to fit every turn.
    Nor is any but beside a curve over a quantity: a term for what changes has not its average in it, and one for
    multiples of the excitation not what is played.
    """
    effect, part = effects.get(name), found.disturbance.depends_on[0]
    asked = (
        part.relative**2 < MORE * found.taken_by(name)
        and bool(part.at)
        and not part.changes
        and (not effect.is_flexible or bool(effect.repeats_over_angle))
    )
    return asked and found.taken_by(name, part) > MIN_SHARE_KEPT_BESIDE_CURVE * found.taken_by(name)


def _is_bound(effect: Effect) -> bool:
    """Whether an effect cannot take up what depends on something: a lag, or a constant."""
    return effect.is_constant or (effect.place in (Place.DRIVE, Place.SENSOR) and not effect.bends_torque)


def _is_one_of_many_curves(name: str, found: Found, traces: Sequence[Trace]) -> bool:
    """Whether an effect is a wave of which no period is seen twice, and more of what it goes with is left."""
    same = {d.on for d in found.disturbance.depends_on} & set(effects.get(name).goes_with)
    return bool(same) and not is_seen_to_repeat(effects.first_of(name), found.named, found.after.values, traces)


def _follows_one_of_its_kind(name: str, found: Found) -> bool:
    """Whether another effect that a curve over the same quantity stands for was taken back, and more goes with that.

    Of all effects of one kind the best one remains when the others are taken back: that it is not in doubt by its size
    says little then.
    """
    kinds = set(CURVES.get(effects.get(name).family, ()))
    taken_back = {c for n in found.taken_back for c in CURVES.get(effects.get(effects.first_of(n)).family, ())}
    return bool({ON[c] for c in kinds & taken_back} & {d.on for d in found.disturbance.depends_on if not d.changes})


def _first(names: Sequence[str], found: Found) -> Sequence[str]:
    """Which go first: flexible ones, for what these had taken up may be another's; then the one that takes least."""
    flexible = [name for name in names if effects.get(name).is_flexible]
    return flexible or sorted(names, key=found.taken_by)[:1]


def _may_stand_in(name: str, found: Found, traces: Sequence[Trace]) -> bool:
    """Whether what is left over speaks against the name of an effect that is in doubt."""
    effect = effects.get(name)
    if not effect.is_flexible or found.disturbance.depends_on[0].on not in effect.goes_with:
        return True
    return not is_seen_to_repeat(effects.first_of(name), found.named, found.after.values, traces)


def _with_unproven(found: Found) -> Found:
    """The same with how far J, C and K move without an effect that does nothing for samples that were held out.

    Where they move the name is kept, for its evidence lies there (a mode beyond what was excited shows as the inertia
    it takes). Where they do not, nothing speaks for it but the likelihood of samples that were fitted, and that may
    take for an effect what is wrong with the torque that was recorded: steps of a coarse current while the platform
    stands look like a friction that holds it.
    """
    moves: dict[str, dict[str, float]] = {}
    gained, begun = found.search.contribution, found
    for name in [n for n in found.named if not contributes(_beyond_noise(gained.get(n, np.inf), found))]:
        less = found.without(name)
        # Of two effects of which either explains it all, neither seems to do anything as long as both are there.
        again = less.in_torque[1].held_relative / max(found.in_torque[1].held_relative, 1e-300)
        if found is not begun and contributes(_beyond_noise(again, found)):
            continue
        if by := moved(found.after, less.after):
            moves[effects.first_of(name)] = by
        else:
            less.search.drop(less.kept)
            found = less
    return replace(found, disturbance=replace(found.disturbance, moves_without_percent=moves)) if moves else found


def _beyond_noise(times: float, found: Found) -> float:
    """How many times as large the held-out error is without an effect, the sensor's noise taken off both."""
    left = found.disturbance.relative
    if times <= 1.0 or not np.isfinite(times) or left <= 0.0:
        return times
    noisy = max(found.in_torque[1].held_relative / left, 1.0)
    return float(np.sqrt(1.0 + (times**2 - 1.0) * noisy**2))


def _taken_back(found: Found, names: Sequence[str], axis: str) -> Found:
    """The same without effects that may only stand in.

    What one that follows almost anything had taken up may be torque of an effect that does not: that is added. One of
    them may be real all the same: J, C and K are no surer than they differ with and without.
    """
    depends = found.disturbance.depends_on
    flexible = any(effects.get(n).is_flexible for n in names)
    goes_with = depends[0].on if depends[0].relative > MOSTLY_LEFT_SHARE else ""
    less = found.without(*names, others=goes_with if flexible else None)
    search = less.search
    follows = " but can follow almost any torque," if flexible else ""
    share, on = number(100.0 * depends[0].relative, 2), quantity_of(depends[0], axis)
    words = (
        f"Not named: {_listed(names)}. This would explain part of what is missing,{follows} and with it {share} % of "
        f"the torque still depends on the {on}."
    )
    search.drop(less.kept, "left open")
    search.left_open = f"{search.left_open} {words}".strip()
    if not less.named:  # the declared model has all of its terms
        search.dropped = []
    apart = dict(found.disturbance.moves_without_percent)
    apart |= {" and ".join(dict.fromkeys(effects.first_of(n) for n in names)): moved(less.after, found.after)}
    return replace(less, disturbance=replace(less.disturbance, moves_without_percent=apart))


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
