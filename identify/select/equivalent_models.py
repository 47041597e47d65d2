"""What an effect of a model may be instead, begun from its numbers: its twins, its likes, a simpler one in it."""

from __future__ import annotations

from collections.abc import Collection

from identify.model.parameters import Name
from identify.select.free_run_fit import Whole
from rig import effects


def special_cases(model: Whole, name: str) -> dict[str, dict[Name, float]]:
    """Start values of every effect that ``name`` contains as a special case.

    A parameter of the same name keeps its value, a gain takes the largest of the richer one's; what has a shape that
    the richer one does not know is left out.
    """
    values, richer = model.values(), effects.get(name)
    gains = [values[(name, p.name)] for p in richer.parameters if p.linear and (name, p.name) in values]
    out: dict[str, dict[Name, float]] = {}
    for simpler in richer.nests:
        own: dict[Name, float] = {}
        for p in effects.get(simpler).parameters:
            if (name, p.name) in values:
                own[(simpler, p.name)] = values[(name, p.name)]
            elif p.linear and gains:
                own[(simpler, p.name)] = max(gains)
        if len(own) == len(effects.get(simpler).parameters):
            out[simpler] = own
    return out


def twins(model: Whole, name: str) -> dict[str, dict[Name, float]]:
    """Start values of every effect that no data, or none within a small travel, tell from ``name``.

    One with the same parameters begins with their values; others as ``Effect.as_rival`` has it, with J, C, K where
    that moves them.
    """
    values, effect = model.values(), effects.get(name)
    mine = {n[1:]: v for n, v in values.items() if n[0] == name}
    out: dict[str, dict[Name, float]] = {}
    for twin in effect.never_separable or {}:
        if {p.name for p in effects.get(twin).parameters} == {k[0] for k in mine}:
            out[twin] = {(twin, *k): v for k, v in mine.items()}
    for rival, instead in (effect.as_rival or {}).items():
        start = instead(tuple(mine.values()))
        terms: dict[Name, float] = {(t,): values.get((t,), 0.0) + more for t, more in start.terms.items()}
        out.setdefault(rival, terms | {(rival, p): v for p, v in start.own.items()})
    return out


def instead_of(
    model: Whole, name: str, near: dict[str, Whole], allowed: Collection[str]
) -> dict[str, dict[Name, float]]:
    """Every effect to be asked in the place of ``name``, and where to begin from.

    ``near`` are the fits of those that came near it when it was chosen.
    """
    out = {other: {n: v for n, v in w.values().items() if n[0] == other} for other, w in near.items()}
    for found in (twins(model, name), special_cases(model, name)):  # two that were found at once were never asked
        for other, own in found.items():
            if other in allowed:
                out.setdefault(other, own)
    return out
