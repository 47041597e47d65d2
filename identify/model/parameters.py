"""Parameter vectors: what their entries are called, where they may lie, which platform they stand for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from identify.model.structure import Structure
from rig import effects
from rig.dynamics import Equations
from rig.platform import TERMS, Platform
from rig.recording.run import Array

Name = tuple[str, ...]


def names_of(structure: Structure, runs: int) -> tuple[Name, ...]:
    """All parameters of a structure: terms, then every parameter of every effect (per run where it is one)."""
    out: list[Name] = [(t,) for t in TERMS if t in structure.terms]
    for name in structure.effects:
        for p in effects.get(name).parameters:
            out += [(name, p.name, str(r)) for r in range(runs)] if p.per_run else [(name, p.name)]
    return tuple(out)


def is_gain(name: Name) -> bool:
    """Whether an effect's parameter enters its torque as a factor."""
    return next(p.linear for p in effects.get(name[0]).parameters if p.name == name[1])


def bounds_of(name: Name, beside: Sequence[Name] = ()) -> tuple[float, float]:
    """Bounds of a parameter: inertia is positive, damping is free, effects say their own.

    Stiffness is free as well, for gravity may push. Where an effect among ``beside``, the parameters of the same model,
    may push itself, the stiffness is that of a spring, which pulls.
    """
    if len(name) > 1:
        parameter = next(p for p in effects.get(name[0]).parameters if p.name == name[1])
        return parameter.low, parameter.high
    if name[0] == "stiffness" and any(effects.get(n[0]).may_push for n in beside if len(n) > 1):
        return 0.0, np.inf
    return (1e-12, np.inf) if name[0] == "inertia" else (-np.inf, np.inf)


def platform_of(
    structure: Structure, names: Sequence[Name], values: Array, run: int = 0, added: float = 0.0
) -> Platform:
    """The platform that a parameter vector stands for in one run."""
    terms = {"inertia": 0.0, "damping": 0.0, "stiffness": 0.0}
    # A run whose own gains were never fitted (it was held out) is simulated without them.
    held: dict[str, dict[str, float]] = {
        name: {p.name: 0.0 for p in effects.get(name).parameters if p.per_run} for name in structure.effects
    }
    for name, value in zip(names, values, strict=True):
        if len(name) == 1:
            terms[name[0]] = float(value)
        elif len(name) == 2 or int(name[2]) == run:
            held[name[0]][name[1]] = float(value)
    return Platform(terms["inertia"] + added, terms["damping"], terms["stiffness"], held, structure.terms)


def with_inertia(ratios: Platform, inertia_kg_m2: float) -> Platform:
    """A platform known per unit of its inertia, as it is with that inertia: it moves the same without torque."""
    scale = inertia_kg_m2 / ratios.inertia_kg_m2
    held = {}
    for name, given in ratios.effects.items():
        effect = effects.get(name)
        held[name] = {p.name: given[p.name] * (scale if effect.per_inertia(p) else 1.0) for p in effect.parameters}
    return replace(
        ratios, inertia_kg_m2=inertia_kg_m2, damping_nm_s_rad=scale * ratios.damping_nm_s_rad,
        stiffness_nm_rad=scale * ratios.stiffness_nm_rad, effects=held,
    )  # fmt: skip


@lru_cache(maxsize=128)
def _equations(structure: Structure, names: tuple[Name, ...], packed: bytes, run: int, added: float) -> Equations:
    return Equations(platform_of(structure, names, np.frombuffer(packed), run, added))


def equations_of(
    structure: Structure, names: Sequence[Name], values: Array, run: int = 0, added: float = 0.0
) -> Equations:
    """The equations that a parameter vector stands for in one run; runs that share them share the object."""
    per_run = any(len(name) == 3 for name in names)
    return _equations(structure, tuple(names), values.tobytes(), run if per_run else 0, added)


def ordered(names: Sequence[Name], values: Array) -> Array:
    """Values with every pair that an effect declares as ordered put in order (static is at least coulomb)."""
    index = {name: i for i, name in enumerate(names)}
    out = values.copy()
    for effect in {n[0] for n in names if len(n) == 2}:
        for smaller, larger in effects.get(effect).ordered:
            i, k = index[(effect, smaller)], index[(effect, larger)]
            if out[i] > out[k]:
                out[i] = out[k] = 0.5 * (out[i] + out[k])
    return out


def in_order(values: Mapping[Name, float], name: str) -> bool:
    """Whether of every ordered pair of an effect the first is the smaller (static friction is at least Coulomb's)."""
    pairs = effects.get(name).ordered
    return all(values.get((name, a), 0.0) <= values.get((name, b), 0.0) * (1.0 + 1e-9) for a, b in pairs)


def gains_at_zero(values: Mapping[Name, float], name: str) -> bool:
    """Whether an effect was fitted to nothing: all its gains at zero."""
    gains = [values.get((name, p.name), 0.0) for p in effects.get(name).parameters if p.linear and not p.per_run]
    return bool(gains) and not any(gains)
