"""Where the shapes of an effect are looked for, before anything is fitted."""

from __future__ import annotations

from itertools import product

from rig.effects.base import Effect, Scale


def grid_of(effect: Effect, scale: Scale) -> list[tuple[float, ...]]:
    """Starting values of an effect's shape parameters."""
    axes = [p.start(scale) if p.start else (1.0,) for p in effect.parameters if not p.linear]
    return [tuple(x) for x in product(*axes)]
