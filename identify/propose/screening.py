"""A quick look at every candidate: its gain in the white-residual regression, shapes searched."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize

from identify.estimate.initial_guess import Start, scale_of
from identify.estimate.regression import Regression, Solution, fit, normal, solve
from identify.model.structure import Label, Shapes, Structure
from identify.signals.trace import Trace
from rig import effects
from rig.effects.base import Effect, Place, Scale
from rig.recording.run import Array

SCREEN_STEPS = (0.03, 0.3, 1.0)
SHAPE_EVALUATIONS = 24
BEYOND = 4.0  # times the outermost starting values: how far a shape may wander
NEAR = 0.8  # of the best gain: a simpler candidate that reaches it is always tried


@dataclass(frozen=True)
class Screened:
    """One candidate after the quick look."""

    effect: str
    shapes: dict[str, tuple[float, ...]]
    gain: float  # in log-likelihood, best over the filters tried
    gains: tuple[float, ...]


def grid_of(effect: Effect, scale: Scale) -> list[tuple[float, ...]]:
    """Starting values of an effect's shape parameters."""
    axes = [p.start(scale) if p.start else (1.0,) for p in effect.parameters if not p.linear]
    return [tuple(x) for x in product(*axes)]


def allowed(values: Mapping[Label, float], name: str) -> bool:
    """Whether an effect's gains lie within their bounds (friction that pushes is no friction)."""
    effect = effects.get(name)
    for parameter in effect.parameters:
        value = values.get((name, parameter.name), 0.0)
        if parameter.linear and not parameter.per_run and not parameter.low <= value <= parameter.high:
            return False
    return all(values.get((name, a), 0.0) <= values.get((name, b), 0.0) for a, b in effect.ordered)


class Screen:
    """Tries candidates on top of one model."""

    def __init__(
        self,
        traces: Sequence[Trace],
        structure: Structure,
        shapes: Shapes,
        start: Start,
        lines_hz: tuple[float, ...] = (),
    ) -> None:
        self.traces, self.structure, self.shapes = traces, structure, dict(shapes)
        self.rhos = [step * start.rho for step in SCREEN_STEPS]
        self._cache: dict[int, dict[Any, Any]] = {}
        base = Regression(traces, structure)
        self.base = [fit(base, shapes, start.platform, rho) for rho in self.rhos]
        best = min(self.base, key=lambda s: s.sigma)
        self.scale = scale_of(traces, best.platform, lines_hz)

    def quick(self, name: str, shape: tuple[float, ...], k: int) -> float:
        """Log-likelihood gained over the current model behind filter k, the filter left as it is."""
        base = self.base[k]
        cache = self._cache.setdefault(threading.get_ident(), {})
        if len(cache) > 4000:  # responses of shapes that were only tried
            cache.clear()
        regression = Regression(self.traces, self.structure.plus(name), cache)
        blocks = regression.blocks(base.denominator, {**self.shapes, name: shape})
        equations = normal(blocks)
        x = solve(equations.a, equations.b)
        values = dict(zip(regression.labels, x.tolist(), strict=True))
        inertia = values.get(("inertia",), base.platform[0])
        if inertia <= 0.0 or not allowed(values, name):
            return -1.0
        # In units of the measured channel: a torque scaled to nothing would leave no residual either.
        rss = equations.rss(x) * (base.platform[0] / inertia) ** 2
        return float(0.5 * equations.count * np.log(base.rms**2 * equations.count / max(rss, 1e-300)))

    def solution(self, look: Screened) -> Solution:
        """A candidate solved behind its best filter, the filter rebuilt from the estimate."""
        k = int(np.argmax(look.gains))
        regression = Regression(self.traces, self.structure.plus(look.effect))
        return fit(regression, look.shapes, self.base[k].platform, self.rhos[k])

    def look(self, name: str) -> Screened | None:
        """The candidate at its best shapes: a grid behind the middle filter, then a local search."""
        effect = effects.get(name)
        if effect.place is Place.SENSOR:
            return None
        middle = 1
        tried = [(self.quick(name, shape, middle), shape) for shape in grid_of(effect, self.scale)]
        if not tried:  # nowhere to look: no spectral line, no periodic torque
            return None
        _, shape = max(tried, key=lambda t: t[0])
        if shape:
            shape = self._search(effect, shape, middle)
        gains = tuple(self.quick(name, shape, k) for k in range(len(self.rhos)))
        return Screened(name, {**self.shapes, name: shape}, max(gains), gains)

    def _search(self, effect: Effect, shape: tuple[float, ...], k: int) -> tuple[float, ...]:
        """Nelder-Mead in the logarithm of the shapes, few steps: output error finishes the work."""
        axes = [p for p in effect.parameters if not p.linear]
        starts = [p.start(self.scale) if p.start else (1.0,) for p in axes]
        bounds = [
            (max(p.low, min(s) / BEYOND), min(p.high, BEYOND * max(s))) for p, s in zip(axes, starts, strict=True)
        ]

        def inside(u: Array) -> tuple[float, ...]:
            return tuple(float(np.clip(np.exp(x), lo, hi)) for x, (lo, hi) in zip(u, bounds, strict=True))

        start: Any = np.log(np.maximum(np.array(shape), 1e-12))
        simplex = np.vstack([start, start + 0.25 * np.eye(len(start))])
        options: Any = {"maxfev": SHAPE_EVALUATIONS, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 0.5}

        def loss(u: Any) -> float:
            return -self.quick(effect.name, inside(u), k)

        found: Any = minimize(loss, start, method="Nelder-Mead", options=options)
        return inside(found.x)

    def all(self, names: Sequence[str]) -> list[Screened]:
        """Every candidate, the most promising first."""
        with ThreadPoolExecutor(2) as workers:
            looks = [x for x in workers.map(self.look, names) if x is not None]
        return sorted(looks, key=lambda s: -s.gain)

    def shortlist(self, looks: Sequence[Screened], most: int) -> list[Screened]:
        """The best behind each filter, and the simplest that comes near it; the best gains first."""
        picked: dict[str, Screened] = {}
        for rank in range(most):
            for k in range(len(self.rhos)):
                order = sorted((s for s in looks if s.gains[k] > 10.0), key=lambda s: -s.gains[k])
                if rank == 0 and order:
                    near = [s for s in order if s.gains[k] > NEAR * order[0].gains[k]]
                    simple = min(near, key=lambda s: len(effects.get(s.effect).parameters))
                    picked.setdefault(simple.effect, simple)
                if rank < len(order):
                    picked.setdefault(order[rank].effect, order[rank])
        return sorted(list(picked.values())[:most], key=lambda s: -s.gain)
