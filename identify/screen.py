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

from identify.prefilter import Denominator
from identify.regression import Label, Regression, Shapes, Solution, Structure, fit, normal, solve
from identify.traces import Trace
from rig import effects
from rig.effects.base import Effect, Place, Scale
from rig.recording.run import Array

RHO_STEPS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)  # of the largest rho that the sensor's noise allows
SCREEN_STEPS = (0.03, 0.3, 1.0)
NOISE_SHARE = 0.001  # of the torque: where noise in the torque residual reaches it, the low-pass cuts off
SHAPE_EVALUATIONS = 24
BEYOND = 4.0  # times the outermost starting values: how far a shape may wander
NEAR = 0.8  # of the best gain: a simpler candidate that reaches it is always tried


@dataclass(frozen=True)
class Start:
    """A first idea of the platform, from the data alone, and what scales follow from it."""

    platform: tuple[float, float, float]
    rho: float  # the largest sensible one
    cutoff_hz: float  # of the torque residual


def first_guess(traces: Sequence[Trace], structure: Structure) -> Start:
    """J, C, K from a low-passed equation error; nothing declared enters.

    The cut-off is where noise of the measured channel, carried into torque, reaches a small share of the
    torque itself; a tenth of the sample rate at most.
    """
    trace = traces[0]
    rate = trace.channel == "rate"
    highest = 0.1 / trace.step_s
    moving = max(2.0, min(highest, *(t.cutoff_hz for t in traces)))
    w = 2.0 * np.pi * moving
    regression = Regression(traces, structure)
    blocks = regression.blocks(Denominator(1.0, 1.4 * w, w * w), {})
    equations = normal(blocks)
    x = solve(equations.a, equations.b)
    found = dict(zip(regression.labels, x, strict=True))
    inertia = 1.0 if regression.torque_free else abs(float(found.get(("inertia",), 1.0)))
    platform = (inertia, float(found.get(("damping",), 0.0)), float(found.get(("stiffness",), 0.0)))
    size = _torque_size(traces, inertia)
    noise = float(np.sqrt(np.mean([t.noise**2 for t in traces])))
    cutoff = highest
    for f in np.geomspace(highest, 0.01 * highest, 60):
        w, share = 2.0 * np.pi * f, np.sqrt(2.0 * f * trace.step_s)
        carried = inertia * w * noise * share / np.sqrt(3.0) if rate else inertia * w * w * noise * share / np.sqrt(5.0)
        cutoff = float(f)
        if carried <= NOISE_SHARE * size:
            break
    w = 2.0 * np.pi * cutoff
    return Start(platform, inertia * w if rate else inertia * w * w, cutoff)


def _torque_size(traces: Sequence[Trace], inertia: float) -> float:
    squares = []
    for t in traces:
        _angle, rate, time, torque, _ = t.fine
        x = torque if t.torque is not None else inertia * np.gradient(rate, time)
        squares.append(float(np.mean(x**2)))
    return float(np.sqrt(np.mean(squares)))


def best_rho(
    traces: Sequence[Trace], structure: Structure, shapes: Shapes, start: Start, use: Sequence[Any] | None = None
) -> Solution:
    """The solution at the ratio of torque disturbance to sensor noise that predicts best."""
    regression = Regression(traces, structure)
    platform = start.platform
    solutions = []
    for step in reversed(RHO_STEPS):  # from the safest filter to the sharpest
        solution = fit(regression, shapes, platform, step * start.rho, use=use)
        solutions.append(solution)
        platform = solution.platform
    return min(solutions, key=lambda s: s.sigma)


def scale_of(
    traces: Sequence[Trace],
    platform: tuple[float, float, float],
    lines_hz: tuple[float, ...],
    ringing_hz: float = 0.0,
    rings_hz: tuple[float, ...] = (),
) -> Scale:
    """How large the motion is."""
    fine = [t.fine for t in traces]
    j, _, k = platform
    return Scale(
        angle_rad=max(float(np.max(np.abs(f[0]))) for f in fine),
        rate_rad_s=max(float(np.max(np.abs(f[1]))) for f in fine),
        torque_nm=max(*(float(np.max(np.abs(f[3]))) for f in fine), 1e-12),
        duration_s=max(t.step_s * len(t.measured) for t in traces),
        step_s=traces[0].step_s,
        natural_frequency_hz=float(np.sqrt(max(k, 1e-12) / max(j, 1e-12)) / (2.0 * np.pi)),
        excitation_hz=tuple(t.run.frequency_hz for t in traces if t.run.frequency_hz),
        lines_hz=lines_hz,
        ringing_hz=ringing_hz,
        rings_hz=rings_hz,
    )


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
