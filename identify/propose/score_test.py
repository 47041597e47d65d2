"""What every candidate could take of the residual of a model that already runs free near the data (score test).

The model is simulated over whole runs. A candidate's direction is what a little of it adds to the simulated
channel; J, C, K, the gains of the effects at hand, start states and bias are projected out of it. The part of the
residual along what is left is the candidate's gain in chi square, without fitting it (Rao 1948; Engle 1984).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from identify.estimate.output_error import Estimate
from identify.model.parameters import Name, bounds_of, platform_of
from identify.propose.effect_tangents import Around, Directions, Push
from identify.propose.screening import grid_of
from identify.signals.trace import UPSAMPLING
from identify.simulate.linearisation import neighbourhood_of
from identify.simulate.sensitivities import nuisance_basis, sensitivities
from identify.simulate.shots import RUNAWAY, Shots, from_rest, make_shots
from rig import effects
from rig.dynamics import Equations
from rig.effects.base import Effect, Scale
from rig.recording.run import Array

SHARPENED = 6  # candidates whose shapes are looked at between the grid
WORTH_SHARPENING = 10.0  # expected fall of chi square
NEARLY = 0.97  # of the squares of the busiest part of a run
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
SECTIONS = 6
SCALED = (0.1, 10.0)  # by how much the score may scale a shape that means "none" at zero


@dataclass(frozen=True)
class Scored:
    """One candidate at one set of shapes.

    Attributes
    ----------
    gain
        Expected fall of chi square.
    start
        Parameter values for a fit to begin from.
    besides
        Where the parameters of the model at hand go to make room for it.
    count
        Its number of parameters.
    shape
        The shape parameters that this is the gain of.
    """

    effect: str
    gain: float
    start: dict[Name, float]
    count: int
    shape: tuple[float, ...] = ()
    besides: dict[Name, float] = field(default_factory=dict)


class Scores:
    """Gains of candidates on top of one model.

    Parameters
    ----------
    estimate
        The model, fitted over whole runs; samples that count are those of its shots.
    fixed
        Parameters that were not fitted.
    sigma
        One standard deviation of the measured channel's noise.
    scale
        How large the motion is.
    share
        How much of each run is looked at, where most happens.
    """

    def __init__(
        self, estimate: Estimate, fixed: Sequence[Name], sigma: float, scale: Scale, share: float = 1.0
    ) -> None:
        self.estimate, self.sigma, self.scale = estimate, sigma, scale
        self.keep = np.array([n not in fixed for n in estimate.names])
        with ThreadPoolExecutor(2) as workers:
            self.runs = list(workers.map(self._around, [self._cut(s, share) for s in estimate.shots]))
        self.directions = Directions(estimate, self.runs, scale)
        information = np.sum([r.columns.T @ r.columns for r in self.runs], axis=0)
        self.size = np.sqrt(np.maximum(np.diag(information), 1e-300))
        self.toward = np.sum([r.columns.T @ r.residual for r in self.runs], axis=0) / self.size
        scaled = information / np.outer(self.size, self.size)
        self.lost = not (np.all(np.isfinite(scaled)) and np.all(np.isfinite(self.toward)))  # the model runs away
        self.inverse = np.linalg.pinv(np.zeros_like(scaled) if self.lost else scaled, rcond=1e-12, hermitian=True)

    def _cut(self, shots: Shots, share: float) -> Shots:
        """The part of a run in which most happens: a soft start shows neither saturation nor travel."""
        if share >= 1.0:
            return shots
        whole = shots.trace
        n = len(whole.measured)
        length = int(share * (n - 1))
        e = self.estimate
        model = Equations(platform_of(e.structure, e.names, e.values, shots.number, shots.added))
        told = whole.measured if whole.torque is None else whole.fine[3][::UPSAMPLING]
        remembers = model.states or model.sensor.names  # that state is known only where the run begins
        begin = 0 if remembers else _busiest(told, length)
        trace = whole.piece(begin, begin + length)
        weight = shots.weight[begin : begin + length + 1]
        if not trace.stretches or not np.any(weight):
            return shots
        ratio = round(whole.step_s / shots.grid.step_s)
        cut = from_rest(make_shots(trace, ratio, None, weight, model), model)
        if begin == 0:
            cut.starts[: len(shots.first)] = shots.starts[: len(cut.first)]
        cut.bias = shots.bias
        return cut

    def _around(self, shots: Shots) -> Around:
        e = self.estimate
        scale = np.where(np.abs(e.values) > 0, np.abs(e.values), 1.0)
        near = neighbourhood_of(
            shots, Equations(platform_of(e.structure, e.names, e.values, shots.number, shots.added))
        )
        columns, state, residual = sensitivities(shots, e.structure, e.names, e.values, scale, ~self.keep, near)
        basis = nuisance_basis(shots, state)
        run = Around(shots, shots.trace.measured - residual, basis, np.zeros((0, 0)), np.zeros(0), near)
        return replace(run, columns=run.project(columns[:, self.keep]), residual=run.project(residual))

    def all(self, names: Sequence[str]) -> list[Scored]:
        """Every candidate at its best shapes, the largest gain first; none on a model that runs away."""
        if self.lost:
            return []
        tasks = [(effects.get(n), shape) for n in names for shape in grid_of(effects.get(n), self.scale)]
        with ThreadPoolExecutor(2) as workers:
            found = [s for s in workers.map(lambda t: self.score(*t), tasks) if s is not None]
            found = [s for s in workers.map(self._at_its_size, found) if s is not None]
        best: dict[str, Scored] = {}
        for s in found:
            if s.effect not in best or s.gain > best[s.effect].gain:
                best[s.effect] = s
        ranked = sorted(best.values(), key=lambda s: -s.gain)
        promising = [s for s in ranked[:SHARPENED] if s.gain > WORTH_SHARPENING]
        with ThreadPoolExecutor(2) as workers:
            sharper = list(workers.map(self.sharpened, promising))
        return sorted(sharper + ranked[len(promising) :], key=lambda s: -s.gain)

    @RUNAWAY
    def score(self, effect: Effect, shape: tuple[float, ...], as_it_is: bool = False) -> Scored | None:
        """One candidate at given shapes; None where it does nothing or its motion runs away.

        ``as_it_is`` scores a candidate that has no gain at its own size, not at the best multiple of it.
        """
        pushes = self.directions.pushes(effect, shape)
        if not pushes:
            return None
        columns = [self.directions.of(effect, push) for push in pushes]
        if any(c is None for c in columns):
            return None
        square = np.zeros((len(pushes),) * 2)
        across, along = np.zeros((int(self.keep.sum()), len(pushes))), np.zeros(len(pushes))
        for k, run in enumerate(self.runs):
            d = np.stack([c[k] for c in columns if c is not None], axis=1)
            square += d.T @ d
            across += run.columns.T @ d / self.size[:, None]
            along += d.T @ run.residual
        square -= across.T @ self.inverse @ across
        along -= across.T @ self.inverse @ self.toward
        lowest = np.array([-np.inf if p[-1] else 0.0 for p in pushes])
        share, gain = _bounded(square, along, lowest)
        if as_it_is:  # without a gain to scale it the candidate is what it is
            share, gain = np.ones(1), max(0.0, float(2.0 * along[0] - square[0, 0]))
        return Scored(
            effect.name, gain / self.sigma**2, self._start(effect, shape, pushes, share), len(effect.parameters), shape,
            self._besides(across @ share),
        )  # fmt: skip

    def _besides(self, taken: Array) -> dict[Name, float]:
        """The parameters at hand, moved by what a candidate takes from their directions."""
        e = self.estimate
        moved = e.values[self.keep] - self.inverse @ taken / self.size
        names = [n for n, on in zip(e.names, self.keep, strict=True) if on]
        return {n: float(np.clip(v, *bounds_of(n))) for n, v in zip(names, moved, strict=True)}

    def _at_its_size(self, found: Scored) -> Scored | None:
        """A candidate without a gain, at the shape on the grid or the multiple of it that promises more."""
        effect = effects.get(found.effect)
        if any(p.linear for p in effect.parameters):
            return found
        multiple = tuple(found.start[(effect.name, p.name)] for p in effect.parameters)
        looks = [self.score(effect, shape, as_it_is=True) for shape in dict.fromkeys((found.shape, multiple))]
        best = max((s for s in looks if s is not None), key=lambda s: s.gain, default=found)
        return best if best.gain > 0.0 else found  # far from the truth only a part of it may promise anything

    def sharpened(self, found: Scored) -> Scored:
        """The same candidate at the best shapes between the neighbours on the grid, one axis after the other.

        Friction finds its shapes over a short horizon, and each look at it costs a simulation of stick and slip.
        """
        effect = effects.get(found.effect)
        if effect.family == "friction":
            return found
        shapes = [p for p in effect.parameters if not p.linear]
        for i, p in enumerate(shapes):
            grid = sorted(p.start(self.scale)) if p.start else []
            if len(grid) < 2:
                continue
            beyond = grid[1] / grid[0], grid[-1] / grid[-2]  # the true shape may lie outside the grid
            below = max((g for g in grid if g < found.shape[i]), default=found.shape[i] / beyond[0])
            above = min((g for g in grid if g > found.shape[i]), default=found.shape[i] * beyond[1])
            found = self._between(effect, found, i, max(below, p.low), min(above, p.high))
        return found

    def _between(self, effect: Effect, found: Scored, axis: int, below: float, above: float) -> Scored:
        """Golden section on one shape, in its logarithm; the best of all that were looked at."""
        if not 0.0 < below < above < np.inf:
            return found
        lo, hi = float(np.log(below)), float(np.log(above))
        at = [hi - GOLDEN * (hi - lo), lo + GOLDEN * (hi - lo)]
        looks = [self._at(effect, found, axis, x) for x in at]
        best = found
        for _ in range(SECTIONS):
            gains = [0.0 if s is None else s.gain for s in looks]
            best = max((best, *(s for s in looks if s is not None)), key=lambda s: s.gain)
            left = gains[0] > gains[1]
            lo, hi = (lo, at[1]) if left else (at[0], hi)
            new = hi - GOLDEN * (hi - lo) if left else lo + GOLDEN * (hi - lo)
            look = self._at(effect, found, axis, new)
            at, looks = ([new, at[0]], [look, looks[0]]) if left else ([at[1], new], [looks[1], look])
        return max((best, *(s for s in looks if s is not None)), key=lambda s: s.gain)

    def _at(self, effect: Effect, found: Scored, axis: int, logarithm: float) -> Scored | None:
        shape = list(found.shape)
        shape[axis] = float(np.exp(logarithm))
        return self.score(effect, tuple(shape), as_it_is=not any(p.linear for p in effect.parameters))

    def _start(
        self, effect: Effect, shape: tuple[float, ...], pushes: Sequence[Push], share: Array
    ) -> dict[Name, float]:
        out: dict[Name, float] = {}
        for (push, _), s in zip(pushes, share, strict=True):
            for name, value in push.items():
                p = next(q for q in effect.parameters if q.name == name[1])
                if p.linear:
                    out[name] = float(np.clip(out.get(name, 0.0) + s * value, p.low, p.high))
                elif len(effect.parameters) == 1 and p.low == 0.0:
                    out[name] = float(np.clip(value * np.clip(s, *SCALED), p.low, p.high))
                else:
                    out[name] = value
        for p in effect.parameters:  # gains whose unit does nothing stay at zero
            if p.linear and not p.per_run:
                out.setdefault((effect.name, p.name), max(p.low, 0.0))
        return out


def _busiest(values: Array, length: int) -> int:
    """Where a window begins that holds the most of a signal's squares; the first of those that hold nearly as much."""
    sums = np.concatenate([[0.0], np.cumsum((values - np.mean(values)) ** 2)])
    held = sums[length:] - sums[: len(sums) - length]
    return int(np.argmax(held[:-1] >= NEARLY * np.max(held[:-1])))


def _bounded(square: Array, along: Array, lowest: Array) -> tuple[Array, float]:
    """Least squares with lower bounds of zero on some unknowns, and the fall of the sum of squares."""
    active = np.ones(len(along), dtype=bool)
    x = np.zeros(len(along))
    for _ in range(len(along) + 1):
        x[:] = 0.0
        if not np.any(active):
            break
        part = square[np.ix_(active, active)]
        size = np.sqrt(np.maximum(np.diag(part), 1e-300))
        inverse = np.linalg.pinv(part / np.outer(size, size), rcond=1e-9, hermitian=True)
        x[active] = inverse @ (along[active] / size) / size
        wrong = active & (x < lowest)
        if not np.any(wrong):
            break
        active &= ~wrong
    return x, max(0.0, float(2.0 * along @ x - x @ square @ x))
