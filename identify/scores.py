"""What every candidate could take of the residual of a model that already runs free near the data (score test).

The model is simulated over whole runs. A candidate's direction is what a little of it adds to the simulated
channel; J, C, K, the gains of the effects at hand, start states and bias are projected out of it. The part of the
residual along what is left is the candidate's gain in chi square, without fitting it (Rao 1948; Engle 1984).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from identify.along import torque_along
from identify.neighbourhood import Neighbourhood, neighbourhood_of
from identify.output_error import Estimate
from identify.parameters import Name, bounds_of, platform_of
from identify.screen import grid_of
from identify.sensitivities import nuisance_basis, sensitivities
from identify.shots import RUNAWAY, Shots, from_rest, make_shots, motion, predict
from identify.traces import UPSAMPLING
from rig import effects
from rig.dynamics import Equations, Grid
from rig.dynamics.equations import MAX_SUBSTEPS
from rig.effects.base import Effect, Place, Scale
from rig.platform import Platform
from rig.recording.run import Array

LITTLE = 1e-4  # of the torque: more of a candidate would shift the ring beyond where sensitivities hold
PHASE_RAD = 0.2  # of a candidate's own fastest motion in one of its steps
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


@dataclass
class _Run:
    """One run around the model: projector, projected sensitivities and residual, and its motion once asked for."""

    shots: Shots
    base: Array
    basis: Array
    columns: Array
    residual: Array
    near: Neighbourhood | None
    along: tuple[Array, Array, Array, Array] | None = None

    def project(self, values: Array) -> Array:
        used = values[self.shots.weight]
        return np.asarray(used - self.basis @ (self.basis.T @ used))


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
        self._finer_ones: dict[tuple[int, int], tuple[Shots, Array]] = {}
        with ThreadPoolExecutor(2) as workers:
            self.runs = list(workers.map(self._around, [self._cut(s, share) for s in estimate.shots]))
        self.largest_first = sorted(self.runs, key=lambda r: -float(np.std(r.base)))
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

    def _around(self, shots: Shots) -> _Run:
        e = self.estimate
        scale = np.where(np.abs(e.values) > 0, np.abs(e.values), 1.0)
        near = neighbourhood_of(
            shots, Equations(platform_of(e.structure, e.names, e.values, shots.number, shots.added))
        )
        columns, state, residual = sensitivities(shots, e.structure, e.names, e.values, scale, ~self.keep, near)
        basis = nuisance_basis(shots, state)
        run = _Run(shots, shots.trace.measured - residual, basis, np.zeros((0, 0)), np.zeros(0), near)
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
        pushes = self._pushes(effect, shape)
        if not pushes:
            return None
        columns = [self._direction(effect, push) for push in pushes]
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

    def _pushes(self, effect: Effect, shape: tuple[float, ...]) -> list[tuple[dict[Name, float], bool]]:
        """A little of the candidate, once for every gain: parameter values, and whether they may turn their sign."""
        shapes = iter(shape)
        held: dict[Name, float] = {(effect.name, p.name): next(shapes) for p in effect.parameters if not p.linear}
        gains = [(i, p) for i, p in enumerate(effect.parameters) if p.linear]
        if not gains:
            return [(held, False)]
        larger = dict(effect.ordered)
        out = []
        for i, p in gains:
            unit = self._unit(effect, shape, i)
            if unit == 0.0:
                continue
            little = LITTLE * self.scale.torque_nm / unit
            rest: dict[Name, float] = {(effect.name, q.name): 0.0 for _, q in gains}
            for run in self.runs if p.per_run else self.runs[:1]:
                number = run.shots.number
                push = dict(rest)
                push[(effect.name, p.name)] = little
                if p.name in larger:
                    push[(effect.name, larger[p.name])] = little
                named = {(*k, str(number)) if p.per_run and k in rest else k: v for k, v in {**held, **push}.items()}
                out.append((named, p.low < 0.0))
        return out

    def _unit(self, effect: Effect, shape: tuple[float, ...], gain: int) -> float:
        """Root mean square torque of a gain of one along the measured motion of the run that moves most."""
        if effect.place in (Place.DRIVE, Place.SENSOR):
            return 1.0
        for run in self.largest_first:
            pieces = run.shots.trace.effect_pieces(effect, shape, gain)
            if pieces is not None:
                return float(np.sqrt(np.mean(pieces[:, 0] ** 2)))
        return 0.0

    def _direction(self, effect: Effect, push: tuple[dict[Name, float], bool]) -> list[Array] | None:
        """What the push adds to the simulated channel of every run, projected."""
        out: list[Array] = []
        for run in self.runs:
            mine = [n for n in push[0] if len(n) < 3 or int(n[2]) == run.shots.number]
            if not any(push[0][n] for n in mine if len(n) == 3) and any(len(n) == 3 for n in push[0]):
                out.append(np.zeros(len(run.residual)))
                continue
            held = {n[1]: push[0][n] for n in mine}
            e = self.estimate
            bare = platform_of(e.structure, e.names, e.values, run.shots.number, run.shots.added)
            platform = replace(bare, effects={**bare.effects, effect.name: held})
            if effect.place is Place.LOAD and not effect.reads:
                moved = self._pushed(run, Equations(bare), effect, held)
            else:
                equations = Equations(platform)
                shots, base = self._finer(run, bare, equations)
                moved = predict(shots, equations, shots.starts, shots.bias) - base
            if not np.all(np.isfinite(moved[run.shots.weight])):
                return None
            out.append(run.project(moved))
        return out

    def _pushed(self, run: _Run, bare: Equations, effect: Effect, held: Mapping[str, float]) -> Array:
        """What the torque that a little of a candidate makes along the model's own motion adds to the channel.

        To first order that is the candidate, however fast its own states are.
        """
        values = effect.values(held)
        s = run.shots
        if run.along is None:
            run.along = run.near.half if run.near else _half_steps(s, bare)
        angle, rate, time, torque = run.along
        step = 0.5 * s.grid.step_s
        substeps = 1
        if effect.states and effect.fastest_rad_s:
            substeps = int(np.clip(np.ceil(step * effect.fastest_rad_s((*bare.jck, *values)) / PHASE_RAD), 1, 16))
        z = np.array(effect.rest_state(angle[0], rate[0]) if effect.rest_state else [0.0] * effect.states, dtype=float)
        out = np.empty_like(angle)
        torque_along(
            effect.kernel.address, angle, rate, time, torque, step, z, substeps, np.array([*bare.jck, *values]),
            False, 1.0, out,
        )  # fmt: skip
        push = np.stack([out[:-1:2], out[1::2], out[2::2]], axis=1)
        return run.near.resisted(push) if run.near else predict(s, bare, s.starts, s.bias, push) - run.base

    def _finer(self, run: _Run, bare: Platform, equations: Equations) -> tuple[Shots, Array]:
        """The same shots on a grid that a fast candidate needs, and the model's own motion there."""
        trace = run.shots.trace
        here = round(trace.step_s / run.shots.grid.step_s)
        needed = int(np.clip(equations.substeps(trace.step_s) // 2, 2, MAX_SUBSTEPS))
        if needed <= here:
            return run.shots, run.base
        needed = min(MAX_SUBSTEPS, 2 ** int(np.ceil(np.log2(needed))))
        key = (run.shots.number, needed)
        if key not in self._finer_ones:
            time = trace.start_s + trace.step_s * np.arange(len(trace.measured))
            shots = replace(run.shots, grid=Grid(time, trace.torque, needed, 0.0))
            self._finer_ones[key] = shots, predict(shots, Equations(bare), shots.starts, shots.bias)
        return self._finer_ones[key]

    def _start(
        self, effect: Effect, shape: tuple[float, ...], pushes: Sequence[tuple[dict[Name, float], bool]], share: Array
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


def _half_steps(s: Shots, equations: Equations) -> tuple[Array, Array, Array, Array]:
    """Angle, rate, time and torque of the model at start, middle and end of its fine steps, (2 m - 1,) each."""
    moving = motion(s, equations, s.starts)
    fine, first, steps, h = moving.fine[:, :2], moving.first, moving.torque, s.grid.step_s
    out = np.empty((2 * len(fine) - 1, 2))
    out[::2] = fine
    slope = np.stack([fine[:, 1], np.gradient(fine[:, 1], h)], axis=1)
    out[1::2] = 0.5 * (fine[1:] + fine[:-1]) + h / 8.0 * (slope[:-1] - slope[1:])
    out[: 2 * first] = fine[first]  # at rest where nothing was simulated
    out[: 2 * first, 1] = 0.0
    torque = np.empty(len(out))
    torque[::2], torque[1::2] = np.append(steps[:, 0], steps[-1, 2]), steps[:, 1]
    return out[:, 0].copy(), out[:, 1].copy(), s.trace.offset_s + 0.5 * h * np.arange(len(out)), torque


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
