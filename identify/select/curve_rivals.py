"""Named effects against curves in their place: a name that a curve over the same quantity beats clearly is a wrong one.

Two or three waves over the angle come near any bump. A curve over the angle has more parameters than the effect that is
there, and is straight between its places, so beside the right effect it is never clearly likelier, all parameters paid
for. Where it is, the torque does depend on the angle, but not as any effect of the library does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identify.bounds.separation import support_difference
from identify.likelihood.fit import Fit
from identify.model.parameter_fit import ParameterFit
from identify.propose.free_forms import fitted, ranges
from identify.propose.innovation_score import InnovationScores
from identify.runs.observability import is_as_strong_in_all, is_seen_to_repeat
from identify.select.evidence import PREDICTS_TO_NOISE, STRONG_SUPPORT
from identify.select.free_form_residual import CURVE_STEPS, ON
from identify.select.trial_fits import COMPARABLE, TRIAL_ITERATIONS
from identify.wording import joined, plain
from rig import effects

if TYPE_CHECKING:
    from identify.select.stepwise import Stepwise

# Of what the effect explains, that a curve has after a few steps: with less it is not followed.
MIN_EARLY_CURVE_SHARE = 0.5
CURVES: Mapping[str, Sequence[str]] = {
    "restoring torque": ("free_angle",), "position-dependent torque": ("free_angle",), "friction": ("free_rate",),
    "drive": ("free_torque",), "surroundings": ("free_time",),
}  # fmt: skip


def is_part_of(name: str, curve: str) -> bool:
    """Whether an effect is of the kind that a curve stands for; a constant torque is a part of any curve."""
    effect = effects.get(name)
    return effect.is_constant or curve in CURVES.get(effect.family, ())


def against_curves(search: Stepwise, now: Fit) -> Fit:
    """A model without names that a curve in their place beats; what else is there is judged beside that curve next."""
    if search.trials.added(now):
        search.say("checking whether an arbitrary curve explains the data better than the named effects")
    found = _beaten(search, now)
    if found is None:
        return now
    names, curve, rest, with_curve = found
    search.in_place = with_curve
    if not all(_seen_to_repeat(n, now, search) for n in names):  # of a wave that is, further orders may make the curve
        alike = [n for n in search.allowed if curve in CURVES.get(effects.get(n).family, ())]
        search.stood_for_curves |= {*names, *alike}  # what is worse than those, and of the same kind, is beaten as well
    search.dropped = [d for d in search.dropped if d[0] not in rest.structure.terms]
    search.dropped += [(n, f"a curve over the {ON[curve]} explains clearly more in its place") for n in names]
    search.say(f"took {joined([plain(n) for n in names])} back: a curve over the {ON[curve]} explains clearly more")
    return rest


def _seen_to_repeat(name: str, now: Fit, search: Stepwise) -> bool:
    effect = effects.get(name)
    have = now.structure.effects
    return bool(effect.repeats_over_angle) and is_seen_to_repeat(
        effects.first_of(name), have, now.values, search.problem.traces
    )


def not_as_strong(fit: ParameterFit, names: Sequence[str]) -> dict[str, str]:
    """Effects that repeat in time and that the runs do not have alike, and why that refutes them."""
    why = "a disturbance from outside is as strong in every run that has it, and this one is not"
    return {n: why for n in names if not is_as_strong_in_all(n, fit.values, fit.std_error)}


def seen_too_little(search: Stepwise, now: Fit) -> dict[str, str]:
    """Waves over the angle of which the travel does not show two periods, where a disturbance limits the recording.

    Any curve over the angle looks like part of a wave. Down to the sensor's noise its exact shape tells the two apart.
    """
    if now.reduced_chi_square < PREDICTS_TO_NOISE:
        return {}
    waves = [n for n in search.trials.added(now) if effects.get(effects.first_of(n)).repeats_over_angle]
    why = "the travel does not show two of its periods, and other effects explain as much"
    return {n: why for n in waves if not _seen_to_repeat(n, now, search)}


def still_offered(search: Stepwise, names: Sequence[str]) -> list[str]:
    """Effects that are not of a kind of which all that was found has stood for a curve; their numbers are no kinds."""
    left = {effects.first_of(n) for n in search.best.structure.effects}
    stood = {effects.first_of(n) for n in search.stood_for_curves} - left
    return [n for n in names if effects.first_of(n) not in stood]


def is_beaten(search: Stepwise, now: Fit) -> bool:
    """Whether a curve in the place of names of one kind explains clearly more."""
    return _beaten(search, now) is not None


def _beaten(search: Stepwise, now: Fit) -> tuple[list[str], str, Fit, Fit] | None:
    """Names that a curve in their place beats, the curve, and the model without them and with it; None where none does.

    Several effects of one kind (two waves over the angle) are judged together, and then all that are a torque over one
    quantity: two of them, of different kinds, may bend to what neither of them is.
    """
    kinds: dict[str, list[str]] = {}
    over: dict[str, list[str]] = {}
    for name in search.trials.added(now):
        kinds.setdefault(effects.first_of(name), []).append(name)
        for curve in CURVES.get(effects.get(name).family, ()):
            over.setdefault(curve, []).append(name)
    groups = [(_curves_of(first), names) for first, names in kinds.items()]
    groups += [([curve], names) for curve, names in over.items() if names not in kinds.values()]
    for curves, names in groups:
        if not curves:
            continue
        rest = _without(search, now, names)
        found = _in_place(search, now, rest, names, curves)
        if found is not None and support_difference(now, found[1]) > STRONG_SUPPORT:
            return names, found[0], rest, found[1]
    return None


def _curves_of(name: str) -> list[str]:
    """Curves that may stand in the place of an effect."""
    effect = effects.get(name)
    return [*CURVES.get(effect.family, ()), *(("free_memory",) if effect.states else ())]


def _in_place(
    search: Stepwise, now: Fit, rest: Fit, names: Sequence[str], curves: Sequence[str]
) -> tuple[str, Fit] | None:  # fmt: skip
    """The best of some curves in the place of effects, fitted; None where none comes near."""
    problem = search.problem
    tests = InnovationScores(problem, rest, search.trials.scale(rest))
    if tests.lost:
        return None
    at = ranges(problem, rest)
    with np.errstate(all="ignore"):
        own = [tests.score(effects.get(n), now.structure.shapes_of(now.values)[n]) for n in names]
        found = [tests.score(effects.get(c), at[c]) for c in curves if c in at]
    score = max((s.gain for s in own if s is not None), default=0.0)
    best = max((s for s in found if s is not None), key=lambda s: s.gain, default=None)
    if best is None or best.gain < COMPARABLE * score:
        return None
    fit = fitted(problem, rest, best, CURVE_STEPS, rest.cost - MIN_EARLY_CURVE_SHARE * (rest.cost - now.cost))
    return (best.effect, fit) if np.isfinite(fit.cost) else None


def _without(search: Stepwise, now: Fit, names: Sequence[str]) -> Fit:
    """A model without some effects, and with the terms that they have replaced: as it was in the search, or fitted."""
    structure = replace(now.structure, terms=search.base.structure.terms)
    for name in names:
        structure = structure.minus(name)
    known = search.known(structure)
    if known is not None:
        return known
    lost = {(t,): search.base.values[(t,)] for t in structure.terms if t not in now.structure.terms}
    values = lost | {k: v for k, v in now.values.items() if k[0] not in names}
    return search.problem.fit(structure, values, now.noise, TRIAL_ITERATIONS, carry=now.shots, thorough=False)
