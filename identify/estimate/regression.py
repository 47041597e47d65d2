"""White-residual regression: J, C, K and the gains of all effects in one linear solve, shapes searched around it.

For a given denominator D (see ``prefilter``) the prefiltered equation is linear in J, C, K and in the gains
of the effects; the start state of every stretch and the gyro's bias are nuisances, projected out. D is
rebuilt from the estimate and the solve repeated until it stands still (Steiglitz-McBride).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identify.model.parameter_fit import ParameterFit
from identify.model.structure import UNIT, Label, Shapes, Structure
from identify.signals.prefilter import Denominator, Prefilter
from identify.signals.trace import UPSAMPLING, Trace
from rig import effects
from rig.effects.base import Effect, Place
from rig.platform import TERMS
from rig.recording.run import Array

ITERATIONS = 4  # times that the denominator is rebuilt from the estimate


@dataclass(frozen=True)
class Block:
    """One stretch of one run, prefiltered: target = columns @ x + bias + free @ n + white noise."""

    columns: Array  # (m, p)
    free: Array  # (m, 2): what an unknown start state adds
    biased: bool
    target: Array  # (m,)
    rows: Any  # sample numbers, (m,)
    trace: int

    @cached_property
    def projected(self) -> Array:
        """Columns, a column of ones where the sensor may be biased, and the target; the free motion taken out."""
        ones = [np.ones(len(self.target))] if self.biased else []
        both = np.column_stack([self.columns, *ones, self.target])
        q = np.linalg.qr(self.free)[0]
        return np.asarray(both - q @ (q.T @ both))


class Regression:
    """The columns of one structure over a set of traces.

    Parameters
    ----------
    traces
        The runs, prepared.
    structure
        Terms and effects of the model.
    cache
        Where responses behind one denominator are kept for other structures; None keeps nothing.

    Where no torque was measured (``torque_free``), inertia is fixed at one and all else is per inertia.
    """

    def __init__(self, traces: Sequence[Trace], structure: Structure, cache: dict[Any, Any] | None = None) -> None:
        self.cache = cache
        self.traces = traces
        self.structure = structure
        self.torque_free = all(t.torque is None for t in traces)
        self.runs = 1 + max(t.number for t in traces)
        labels = structure.labels(self.runs)
        self.labels = tuple(x for x in labels if not (self.torque_free and x == ("inertia",)))

    def blocks(self, denominator: Denominator, shapes: Shapes) -> list[Block]:
        """All stretches of all traces, prefiltered."""
        filters: dict[tuple[float, Denominator], Prefilter] = {}
        out = []
        for i, trace in enumerate(self.traces):
            own = denominator if self.torque_free else denominator.loaded(trace.run.added_inertia_kg_m2)
            pre = filters.setdefault((trace.step_s, own), Prefilter(own, trace.step_s))
            for stretch in trace.stretches:
                out.append(self._block(pre, i, trace, stretch, shapes))
        return out

    def _block(self, pre: Prefilter, number: int, trace: Trace, stretch: tuple[int, int], shapes: Shapes) -> Block:
        first, last = stretch
        rate = trace.channel == "rate"
        out = 1 if rate else 0  # which response carries a torque into the units of the measured channel
        d = pre.denominator
        m = last - first + 1

        place = (number, first, d)

        def kept(what: Any, make: Callable[[], Any]) -> Any:
            if self.cache is None:
                return make()
            key = (place, what)
            if key not in self.cache:
                self.cache[key] = make()
            return self.cache[key]

        def through(pieces: Array, upsampling: int) -> Array:
            return pre.respond(pieces, first, last, upsampling)[:, out]

        y = trace.measured[first : last + 1]

        def linear() -> dict[str, Array]:
            low = pre.respond(trace.measured_pieces, first, last)
            acceleration = (y - d.damping * low[:, 1] - d.stiffness * low[:, 0]) / d.inertia
            return {"stiffness": low[:, 0], "damping": low[:, 1], "inertia": acceleration}

        base = kept("linear", linear)
        drive = tuple(
            (name, tuple(shapes[name])) for name in self.structure.effects
            if effects.get(name).place is Place.DRIVE
        )  # fmt: skip
        torque = trace.torque_pieces(drive)
        target = np.zeros(m) if torque is None else kept(drive, lambda: through(*torque))
        if trace.run.added_inertia_kg_m2:
            target = target - trace.run.added_inertia_kg_m2 * base["inertia"]
        columns: dict[Label, Array] = {}
        for term in TERMS:
            if term in self.structure.terms:
                columns[(term,)] = base[term]
        self._add_effects(columns, through, kept, trace, shapes, m)
        if self.torque_free:
            target = target - columns.pop(("inertia",))
        free = kept("free", lambda: pre.free(m))
        rows = np.nonzero(trace.keep[first : last + 1])[0]
        nothing = np.zeros(m)  # a gain in the sensor or the drive pushes nothing along the measured motion
        matrix = np.column_stack([columns.get(x, nothing) for x in self.labels])
        return Block(matrix[rows], free[rows], trace.biased, target[rows], rows + first, number)

    def _add_effects(
        self, columns: dict[Label, Array], through: Any, kept: Any, trace: Trace, shapes: Shapes, m: int
    ) -> None:
        for name in self.structure.effects:
            effect = effects.get(name)
            if effect.place in (Place.DRIVE, Place.SENSOR):
                continue
            shape = tuple(shapes.get(name, ()))

            def response(effect: Effect, shape: tuple[float, ...], unit: int) -> Array:
                pieces = trace.effect_pieces(effect, shape, unit)
                return np.zeros(m) if pieces is None else through(pieces, UPSAMPLING)

            for i, parameter in enumerate(effect.parameters):
                if not parameter.linear:
                    continue
                column = kept((name, shape, i), lambda effect=effect, shape=shape, i=i: response(effect, shape, i))
                if parameter.per_run:
                    for r in range(self.runs):
                        columns[(name, parameter.name, str(r))] = column if r == trace.number else np.zeros(m)
                else:
                    columns[(name, parameter.name)] = column
            for term in effect.leans_on:
                if (term,) in columns:
                    columns[(term,)] = columns[(term,)] + response(effect, shape, UNIT[term])


@dataclass(frozen=True)
class RegressionFit(ParameterFit):
    """A solved regression.

    Its residual is prefiltered. The cost counts the gain of the prefilter (its logarithmic mean over frequency): so
    solutions with different rho compare.

    Attributes
    ----------
    names, vector
        Linear parameters, (p,): what is solved for.
    shapes
        Shape parameters that it was solved at.
    jck
        Inertia (one where no torque was measured), damping and stiffness.
    """

    shapes: Shapes
    denominator: Denominator
    rho: float
    jck: tuple[float, float, float]


@dataclass(frozen=True)
class Normal:
    """Normal equations of a regression, start states and biases eliminated."""

    a: Array  # (p, p)
    b: Array  # (p,)
    c: float
    count: int

    def __add__(self, other: Normal) -> Normal:
        return Normal(self.a + other.a, self.b + other.b, self.c + other.c, self.count + other.count)

    def rss(self, x: Array) -> float:
        """Sum of squares that a parameter vector leaves."""
        return max(float(self.c - 2.0 * (self.b @ x) + x @ self.a @ x), 0.0)


def normal(blocks: Sequence[Block], use: Sequence[Any] | None = None) -> Normal:
    """Normal equations of some blocks.

    ``use`` holds a boolean array for each trace (True where a sample counts), or None for all. A bias is
    common to all stretches of a run.
    """
    p = blocks[0].columns.shape[1]
    total = Normal(np.zeros((p, p)), np.zeros(p), 0.0, 0)
    for trace in sorted({block.trace for block in blocks}):
        width = p + (2 if any(b.biased for b in blocks if b.trace == trace) else 1)
        g, count = np.zeros((width, width)), 0
        for block in blocks:
            if block.trace == trace:
                m = block.projected
                m = m if use is None else m[use[trace][block.rows]]
                g += m.T @ m
                count += len(m)
        if width == p + 2 and g[p, p] > 0.0:
            g = g - np.outer(g[:, p], g[p, :]) / g[p, p]
        total = total + Normal(g[:p, :p], g[:p, -1], float(g[-1, -1]), count)
    return total


def residuals(blocks: Sequence[Block], x: Array) -> list[Array]:
    """Prefiltered residual of every block, start states and biases fitted, each of shape (m,)."""
    out: list[Array] = []
    for block in blocks:
        r = block.projected[:, -1] - block.projected[:, : len(x)] @ x
        if block.biased:
            one = block.projected[:, len(x)]
            r = r - one * (one @ r) / max(float(one @ one), 1e-300)
        out.append(r)
    return out


def solve(normal: Array, right_side: Array) -> Array:
    """Least squares from normal equations, columns scaled; the direction that nothing determines stays zero."""
    if not (np.all(np.isfinite(normal)) and np.all(np.isfinite(right_side))):
        return np.zeros(len(right_side))
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(scale, scale)
    return np.asarray(np.linalg.lstsq(scaled, right_side / scale, rcond=1e-13)[0] / scale)


def log_gain(platform: tuple[float, float, float], denominator: Denominator, step_s: float) -> float:
    """Mean over frequency of log |A / D|: what the prefilter does to white noise in the measured channel."""
    w = 2.0 * np.pi * (np.arange(2048) + 0.5) / 2048 * 0.5 / step_s
    j, c, k = platform
    a = (k - j * w * w) ** 2 + (c * w) ** 2
    d = (denominator.stiffness - denominator.inertia * w * w) ** 2 + (denominator.damping * w) ** 2
    return float(0.5 * np.mean(np.log(np.maximum(a, 1e-300) / d)))


def fit(
    regression: Regression,
    shapes: Shapes,
    start: tuple[float, float, float],
    rho: float,
    iterations: int = ITERATIONS,
    use: Sequence[Any] | None = None,
) -> RegressionFit:
    """Solve at a fixed rho and fixed shapes, the denominator rebuilt from the estimate ``iterations`` times.

    ``start`` are J, C, K of the first denominator.
    """
    platform = start
    rate = regression.traces[0].channel == "rate"
    for k in range(max(1, iterations)):
        denominator = Denominator.of(*platform, rho, rate)
        blocks = regression.blocks(denominator, shapes)
        equations = normal(blocks, use)
        x = solve(equations.a, equations.b)
        found = dict(zip(regression.labels, x, strict=True))
        inertia = 1.0 if regression.torque_free else float(found.get(("inertia",), 0.0))
        new = (inertia, float(found.get(("damping",), 0.0)), float(found.get(("stiffness",), 0.0)))
        if new[0] <= 0.0:  # nothing to filter with: keep the last usable denominator
            new = (platform[0], max(new[1], 0.0), max(new[2], 0.0))
        change = abs(new[0] / platform[0] - 1.0) + abs(new[2] - platform[2]) / max(abs(platform[2]), 1e-9)
        platform = new
        if k > 0 and change < 1e-7:
            break
    n, rss = equations.count, equations.rss(x)
    if rss < 1e-6 * equations.c:  # the difference of two large numbers: take it from the residual itself
        parts = zip(blocks, residuals(blocks, x), strict=True)
        rss = sum(float(np.sum((r if use is None else r[use[b.trace][b.rows]]) ** 2)) for b, r in parts)
    variance = rss / max(n, 1)
    gain = log_gain(platform, denominator, regression.traces[0].step_s)
    cost = n * (float(np.log(max(variance, 1e-300))) - 2.0 * gain)
    return RegressionFit(
        regression.structure, regression.labels, x, n, variance, cost, equations.a, dict(shapes), denominator, rho,
        platform,
    )  # fmt: skip
