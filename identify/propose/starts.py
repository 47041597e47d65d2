"""Where a candidate's fit begins: from its times alone, from what it does in torque, or from where another stands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.likelihood.fit import Fit
from identify.model.parameters import Name
from identify.propose.torque_looks import CandidateTorque
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place, Scale

OTHER_START = 1.5  # times the power in torque that a look leaves: a fit that leaves more is begun from there, too


def about_a_sample(name: str, scale: Scale, step_s: float) -> dict[Name, float]:
    """An effect without gains, its times about a sample long."""
    return {
        (name, p.name): sorted(p.start(scale), key=lambda t: abs(np.log(t / step_s)))[0]
        for p in effects.get(name).parameters if p.start is not None
    }  # fmt: skip


def stable_part(fit: Fit, moved: Array, longest_s: float) -> float:
    """How much of a change of a model's gains leaves a platform that does not run away during a run.

    Of two numbers that do nearly the same (a delay of the drive and a damping) one may go beyond zero by what the other
    takes back. A prediction that rings up is no place to begin: no step leads down from there.
    """
    inertia = fit.values.get(("inertia",), 0.0)
    least = {("damping",): -2.0 * inertia / longest_s, ("stiffness",): -inertia / longest_s**2}  # e-fold in a run
    part = 1.0
    for name, change in zip(fit.names, moved, strict=True):
        if name in least and fit.values[name] + change < least[name] < fit.values[name]:
            part = min(part, float((least[name] - fit.values[name]) / change))
    return part


def gain_of(fit: Fit, name: str) -> float:
    """An effect's first gain."""
    return next((fit.values[(name, p.name)] for p in effects.get(name).parameters if p.linear and not p.per_run), 0.0)


def is_small(name: str, begun: Mapping[Name, float], start: CandidateTorque) -> bool:
    """Whether dry friction was begun far below what it has in torque: where it sticks, a fit stays there."""
    if effects.get(name).place is not Place.FRICTION:
        return False
    gains = [(name, p.name) for p in effects.get(name).parameters if p.linear]
    return any(OTHER_START * abs(begun.get(g, 0.0)) < abs(start.start.get(g, 0.0)) for g in gains)


def as_special_case(name: str, own: Fit, special: str, fit: Fit) -> dict[Name, float] | None:
    """Values with which an effect does what its special case does where that stands; None where nobody knows them.

    Values of its own that make no difference then are as in its ``own`` fit.
    """
    same = (effects.get(name).from_special or {}).get(special)
    if same is None:
        return None
    of_special = tuple(fit.values[(special, p.name)] for p in effects.get(special).parameters)
    known: dict[Name, float] = {(name, key): value for key, value in same(of_special).items()}
    return {n: v for n, v in fit.values.items() if n[0] != special} | {
        n: v for n, v in own.values.items() if n[0] == name
    } | known  # fmt: skip
