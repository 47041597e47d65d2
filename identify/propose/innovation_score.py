"""What every candidate could take of what a model predicts wrongly, without fitting it (score test).

The model is fitted by prediction error. A candidate's direction is what a little of it changes in the innovations; the
model's own parameters and the runs' biases are projected out of it. The part of the innovations along what is left is
the candidate's gain in log-likelihood (Rao 1948; Engle 1984). A torque that the model lacks is taken up by the
predictor's disturbance, so the prediction stays near the data and the scores mean something from the first round on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimate.covariance import own_basis
from identify.likelihood.fit import MAX_LINEAR_INERTIA_CHANGE, Fit
from identify.likelihood.normal_equations import NORMAL_RCOND
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameter_fit import sizes
from identify.model.parameters import Name, bounds_of, names_of
from identify.propose.shape_grids import grid_of
from identify.propose.starts import stable_part
from identify.simulate.shots import RUNAWAY
from rig import effects
from rig.arrays import Array
from rig.effects.base import Effect, Place, Scale

LITTLE = 1e-3  # of the torque: how much of a candidate is tried
SCALED = (0.1, 10.0)  # by how much a score may scale a shape that means "none" at zero
SHAPES = 3  # of a candidate that are kept to begin a fit from
SYNERGY = 2.0  # times what both are worth alone, that two at once are worth: else one leads to the other

Push = tuple[dict[Name, float], bool]  # parameter values of a little of a candidate, and whether it may turn its sign


@dataclass(frozen=True)
class Score:
    """One candidate at one set of shapes.

    Attributes
    ----------
    gain
        Expected fall of the cost (minus twice the log-likelihood).
    start
        Its parameter values for a fit to begin from, and the model's own gains as they follow it.
    """

    effect: str
    gain: float
    start: dict[Name, float]
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Projected:
    """What a little of a candidate does to the innovations, (n, k), the model's own parameters projected out.

    ``along_base`` is what was projected out, (b, k).
    """

    columns: Array
    pushes: list[Push]
    along_base: Array

    def solved(self, residual: Array) -> tuple[Array, float]:
        """How many times each push explains most of a residual, (k,), and the fall of the sum of squares."""
        size = np.sqrt(np.sum(self.columns**2, axis=0))
        square, along = self.columns.T @ self.columns / np.outer(size, size), self.columns.T @ residual / size
        lowest = np.array([-np.inf if free else 0.0 for _, free in self.pushes])
        share, fall = bounded(square, along, lowest)
        return share / size, fall

    def beside(self, other: _Projected) -> _Projected:
        """Two candidates at once."""
        return _Projected(
            np.column_stack([self.columns, other.columns]), [*self.pushes, *other.pushes],
            np.column_stack([self.along_base, other.along_base]),
        )  # fmt: skip


class InnovationScores:
    """Gains of candidates on top of one model.

    Parameters
    ----------
    problem
        The runs, and how they are predicted.
    fit
        The model.
    scale
        How large the motion is.
    """

    def __init__(self, problem: PredictionError, fit: Fit, scale: Scale) -> None:
        self.problem, self.fit, self.scale = problem, fit, scale
        # A low-pass that is tried filters no noise yet: that would change the variance, and a score compares at one.
        filtered = any(effects.get(e).lag is not None for e in fit.structure.effects)
        self.noise = fit.noise if filtered else problem.bounds.within(replace(fit.noise, ahead=0.0))
        parts = problem.columns_at(fit)
        self.own = [own_basis(p.own) for p in parts]
        self.base = [p.scaled for p in parts]
        self.variance = [p.variance for p in parts]
        columns = np.concatenate([p.columns - q @ (q.T @ p.columns) for p, q in zip(parts, self.own, strict=True)])
        rest = np.concatenate([p.scaled - q @ (q.T @ p.scaled) for p, q in zip(parts, self.own, strict=True)])
        self.lost = not (np.all(np.isfinite(columns)) and np.all(np.isfinite(rest)))  # the model runs away
        if self.lost:
            return
        size = sizes(np.sum(columns**2, axis=0))
        u, s, v = np.linalg.svd(columns / size, full_matrices=False)
        kept = s > 1e-7 * max(float(s[0]) if len(s) else 0.0, 1e-300)
        self.basis = u[:, kept]
        self.follow = -(v[kept].T / s[kept]) / size[:, None]  # of the model's parameters, for what is projected out
        self.residual = rest - self.basis @ (self.basis.T @ rest)
        self.square = float(self.residual @ self.residual)
        at = fit.structure, fit.names, fit.vector, self.noise
        self.gains = [problem.gains_at(s, *at) for s in fit.shots]

    def pairs(self, singles: Sequence[Score]) -> list[tuple[Score, Score, float]]:
        """Two candidates at once, at the shapes of their single scores: the pairs that are worth more than twice what
        both are worth alone, the largest gain first.

        A friction that levels off and a drag that grows with the square of the rate are both nearly a damping, each
        with what the other lacks: either alone shows little.
        """
        if self.lost:
            return []
        with np.errstate(all="ignore"):
            found = self.problem.workers.each(lambda s: self._projected(effects.get(s.effect), s.shape), singles)
            parts = [(s, p) for s, p in zip(singles, found, strict=True) if p is not None]
        out: list[tuple[Score, Score, float]] = []
        for i, (one, mine) in enumerate(parts):
            for other, theirs in parts[:i]:
                if {one.effect, other.effect} & {*effects.get(one.effect).nests, *effects.get(other.effect).nests}:
                    continue
                share, fall = mine.beside(theirs).solved(self.residual)
                gain = self._gain(fall)
                if gain > SYNERGY * (one.gain + other.gain):
                    k = len(mine.pushes)
                    first = replace(one, start=_start(effects.get(one.effect), mine.pushes, share[:k]))
                    second = replace(other, start=_start(effects.get(other.effect), theirs.pushes, share[k:]))
                    out.append((first, second, gain))
        return sorted(out, key=lambda pair: -pair[2])

    def all(self, names: Sequence[str]) -> list[list[Score]]:
        """Every candidate at its best shapes, the largest gain first; of each a few shapes to begin from."""
        if self.lost:
            return []
        tasks = [(effects.get(n), shape) for n in names for shape in grid_of(effects.get(n), self.scale)]
        with np.errstate(all="ignore"):
            found = [s for s in self.problem.workers.each(lambda t: self.score(*t), tasks) if s is not None]
        of: dict[str, list[Score]] = {}
        for s in sorted(found, key=lambda s: -s.gain):
            of.setdefault(s.effect, []).append(s)
        return sorted((v[:SHAPES] for v in of.values()), key=lambda v: -v[0].gain)

    @RUNAWAY
    def score(self, effect: Effect, shape: tuple[float, ...]) -> Score | None:
        """One candidate at given shapes; None where it does nothing."""
        there = self._projected(effect, shape)
        if there is None:
            return None
        share, fall = there.solved(self.residual)
        gain = self._gain(fall)
        gainless = not any(p.linear for p in effect.parameters)
        if gainless:
            one = there.columns[:, 0]
            as_it_is = self._gain(float(2.0 * one @ self.residual - one @ one))
            if as_it_is > 0.5 * gain:  # where it does as well at its own size, that is a better place to begin
                return Score(effect.name, max(gain, as_it_is), dict(there.pushes[0][0]), shape)
        moved = self.follow @ (there.along_base @ share)
        part = stable_part(self.fit, moved, self.problem.longest_s)
        start = {**self._followed(part * moved), **_start(effect, there.pushes, part * share)}
        return Score(effect.name, gain, start, shape)

    @RUNAWAY
    def _projected(self, effect: Effect, shape: tuple[float, ...]) -> _Projected | None:
        """What a little of a candidate does that the model's own parameters do not; None where it does nothing."""
        pushes = self._pushes(effect, shape)
        columns = [c for c in (self._direction(effect, push) for push, _ in pushes) if c is not None]
        if not columns or len(columns) != len(pushes):
            return None
        wide = np.stack(columns, axis=1)
        along_base = self.basis.T @ wide
        wide = wide - self.basis @ along_base
        size = np.sum(wide**2, axis=0)
        if not np.all(np.isfinite(size)) or np.any(size <= 0.0):
            return None
        return _Projected(wide, pushes, along_base)

    def _followed(self, moved: Array) -> dict[Name, float]:
        """The model's gains where they follow a candidate; as they are where that takes them far."""
        there = {}
        for name, value, change in zip(self.fit.names, self.fit.vector, moved, strict=True):
            linear = len(name) == 1 or next(p.linear for p in effects.get(name[0]).parameters if p.name == name[1])
            if linear:
                there[name] = float(np.clip(value + change, *bounds_of(name, self.fit.names)))
        kept = self.fit.values.get(("inertia",), 0.0)
        near = abs(there.get(("inertia",), kept) - kept) <= MAX_LINEAR_INERTIA_CHANGE * abs(kept)
        return there if near and all(np.isfinite(list(there.values()))) else {}

    def _gain(self, fall: float) -> float:
        count = len(self.residual)
        return float(-count * np.log(max(1.0 - fall / self.square, 1e-12))) if fall > 0.0 else 0.0

    def _pushes(self, effect: Effect, shape: tuple[float, ...]) -> list[Push]:
        """A little of the candidate, once for every gain."""
        shapes = iter(shape)
        held: dict[Name, float] = {(effect.name, p.name): next(shapes) for p in effect.parameters if not p.linear}
        gains = [(i, p) for i, p in enumerate(effect.parameters) if p.linear]
        if not gains:
            return [(held, False)]
        larger = dict(effect.ordered)
        out: list[Push] = []
        for i, p in gains:
            unit = self._unit(effect, shape, i)
            if unit == 0.0:
                continue
            little = LITTLE * self.problem.torque_nm / unit
            for run in self.fit.shots if p.per_run else self.fit.shots[:1]:
                push = dict(held)
                own = (effect.name, p.name, str(run.number)) if p.per_run else (effect.name, p.name)
                push[own] = little
                if p.name in larger:
                    push[(effect.name, larger[p.name])] = little
                out.append((push, p.low < 0.0))
        return out

    def _unit(self, effect: Effect, shape: tuple[float, ...], gain: int) -> float:
        """Root mean square torque of a gain of one along the measured motion."""
        if effect.place in (Place.DRIVE, Place.SENSOR):
            return 1.0
        for trace in self.problem.traces:
            pieces = trace.effect_pieces(effect, shape, gain)
            if pieces is not None:
                size = float(np.sqrt(np.mean(pieces[:, 0] ** 2)))
                if size > 0.0:
                    return size
        return 0.0

    def _direction(self, effect: Effect, push: dict[Name, float]) -> Array | None:
        """What the push changes in the scaled innovations of all runs, the runs' own unknowns projected out."""
        fit = self.fit
        structure = fit.structure.plus(effect.name)
        names = names_of(structure, self.problem.runs)
        vector = np.array([fit.values.get(n, push.get(n, 0.0)) for n in names])
        own = {int(n[2]) for n in push if len(n) == 3}
        moved = list(self.base)
        spread = 0.0  # of the logarithms of the variance: a lag changes the gains, and what the prediction errs by
        # A little of a torque does next to nothing to them.
        changes_gains = effect.place is Place.SENSOR or effect.has_linear_states
        for i, s in enumerate(fit.shots):
            if own and s.number not in own:
                continue
            gains = None if changes_gains else self.gains[i]
            look = self.problem.look(s, structure, names, vector, self.noise, gains)
            variance = look.variance[s.weight].ravel()
            moved[i] = look.innovations[s.weight].ravel() / np.sqrt(variance)
            spread += float(np.sum(np.log(variance / self.variance[i])))
            if not np.all(np.isfinite(moved[i])):
                return None
        level = np.exp(0.5 * spread / len(self.residual))  # the scale of all variances is free
        changes = [b - level * m for b, m in zip(self.base, moved, strict=True)]
        return np.concatenate([c - q @ (q.T @ c) for c, q in zip(changes, self.own, strict=True)])


def _start(effect: Effect, pushes: Sequence[Push], share: Array) -> dict[Name, float]:
    out: dict[Name, float] = {}
    for (push, _), s in zip(pushes, share, strict=True):
        for name, value in push.items():
            p = next(q for q in effect.parameters if q.name == name[1])
            if p.linear:
                out[name] = float(np.clip(out.get(name, 0.0) + s * value, *bounds_of(name)))
            elif len(effect.parameters) == 1 and p.low == 0.0:
                out[name] = float(np.clip(value * np.clip(s, *SCALED), p.low, p.high))
            else:
                out[name] = value
    for p in effect.parameters:  # gains whose unit does nothing stay at zero
        if p.linear and not p.per_run:
            out.setdefault((effect.name, p.name), max(p.low, 0.0))
    return out


def bounded(square: Array, along: Array, lowest: Array) -> tuple[Array, float]:
    """Least squares with lower bounds of zero on some unknowns, and the fall of the sum of squares."""
    active = np.ones(len(along), dtype=bool)
    x = np.zeros(len(along))
    for _ in range(len(along) + 1):
        x[:] = 0.0
        if not np.any(active):
            break
        x[active] = np.linalg.pinv(square[np.ix_(active, active)], rcond=NORMAL_RCOND, hermitian=True) @ along[active]
        wrong = active & (x < lowest)
        if not np.any(wrong):
            break
        active &= ~wrong
    return x, max(0.0, float(2.0 * along @ x - x @ square @ x))
