"""The steps of an output-error fit: Gauss-Newton with Levenberg's damping, outlying shots counting less.

Sensitivities are differences of simulations; start states, gyro bias and global parameters are solved together, start
states eliminated first.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from identify.model.parameters import Name, bounds_of, ordered
from identify.model.structure import Structure
from identify.simulate.sensitivities import Reduced, at_residual, linearise
from identify.simulate.shots import RUNAWAY, Shots, moved, residual_at
from rig.recording.run import Array

ROBUST_FROM = 12  # shots: fewer show no outlier
OUTLIER = 4.0  # times the median error of a shot
MAX_PREDICTION_MISS = 0.1  # of the fall of the squares that sensitivities may miss to be kept


def _total(parts: Sequence[Reduced]) -> tuple[Array, Array, Array, Array]:
    return (
        np.sum([q.a for q in parts], axis=0), np.sum([q.b for q in parts], axis=0),
        np.concatenate([q.losses for q in parts]), np.concatenate([q.counts for q in parts]),
    )  # fmt: skip


def _outlier(losses: Array, counts: Array) -> float:
    """Root mean square beyond which a shot is mistrusted; none is where there are only a few."""
    used = counts > 0
    if np.sum(used) < ROBUST_FROM or not np.all(np.isfinite(losses[used])):
        return np.inf
    return float(OUTLIER * np.sqrt(max(np.median(losses[used] / counts[used]), 1e-300)))


def _cost(losses: Array, counts: Array, outlier: float) -> float:
    """Sum of squares, with the shots that are mistrusted growing only as a logarithm."""
    if not np.isfinite(outlier):
        return float(np.sum(losses))
    n = np.maximum(counts, 1.0)
    return float(np.sum(n * outlier**2 * np.log1p(losses / n / outlier**2)))


class GaussNewton:
    """Gauss-Newton with Levenberg's damping, sensitivities kept as long as they foretell what a step brings.

    A step costs a simulation of every run; new sensitivities cost one for every parameter besides.
    """

    def __init__(
        self, workers: ThreadPoolExecutor, shots: list[Shots], structure: Structure, names: tuple[Name, ...],
        x: Array, still: Any,
    ) -> None:  # fmt: skip
        self.workers, self.shots, self.structure, self.names, self.x = workers, shots, structure, names, x
        self.still = still
        self.scale = np.where(np.abs(x) > 0, np.abs(x), 1.0)
        self.low = np.array([bounds_of(n, names)[0] for n in names])
        self.high = np.array([bounds_of(n, names)[1] for n in names])
        self.damping = 1e-6
        self.counts = np.concatenate([s.counts for s in shots])
        self.count = int(np.sum(self.counts))
        found = list(workers.map(lambda s: residual_at(s, structure, names, x), shots))
        self.residuals = [r for r, _ in found]
        self.outlier = _outlier(np.concatenate([each for _, each in found]), self.counts)
        self.renew()

    def renew(self) -> None:
        """Sensitivities where the descent stands."""
        self.parts = list(
            self.workers.map(
                lambda s: linearise(s, self.structure, self.names, self.x, self.scale, self.still, self.outlier),
                self.shots,
            )
        )
        self.fresh = True
        self._add_up()

    def keep(self) -> None:
        """The sensitivities at hand, with the residual where the descent stands."""
        self.parts = [
            at_residual(q, s, r, self.outlier) for q, s, r in zip(self.parts, self.shots, self.residuals, strict=True)
        ]
        self.fresh = False
        self._add_up()

    def _add_up(self) -> None:
        self.a, self.b, self.losses, _ = _total(self.parts)

    @property
    def cost(self) -> float:
        """Sum of squares, mistrusted shots counting less."""
        return _cost(self.losses, self.counts, self.outlier)

    @property
    def lost(self) -> bool:
        """Whether the simulation ran away."""
        return not (np.all(np.isfinite(self.losses)) and np.all(np.isfinite(self.a)) and np.all(np.isfinite(self.b)))

    @RUNAWAY
    def step(self) -> Step | None:
        """One step down; None where none leads there."""
        cost = self.cost
        size = np.sqrt(np.maximum(np.diag(self.a), 1e-300))
        free = ~self.still
        scaled, right = (self.a / np.outer(size, size))[np.ix_(free, free)], (self.b / size)[free]
        if not (np.all(np.isfinite(scaled)) and np.all(np.isfinite(right))):
            return None
        for _ in range(8 if self.fresh else 1):
            dx = np.zeros(len(self.x))
            dx[free] = np.linalg.lstsq(scaled + self.damping * np.eye(int(free.sum())), right, rcond=1e-14)[0]
            new = ordered(self.names, np.clip(self.x + dx / size, self.low, self.high))
            steps = [q.back(new - self.x) for q in self.parts]
            trial = [moved(s, m) for s, m in zip(self.shots, steps, strict=True)]
            found = list(self.workers.map(lambda s, new=new: residual_at(s, self.structure, self.names, new), trial))
            losses = np.concatenate([each for _, each in found])
            after = _cost(losses, self.counts, self.outlier)
            if after <= cost * (1.0 + 1e-12):
                residuals = [r for r, _ in found]
                missed = self._missed(new - self.x, steps, residuals)
                length = float(np.max(np.abs(new - self.x) * size / np.sqrt(cost / max(self.count, 1)), initial=0.0))
                self.x, self.shots, self.residuals = new, trial, residuals
                self.damping = max(self.damping / 30.0, 1e-9)
                self.outlier = _outlier(losses, self.counts)
                return Step(length, cost - after, cost, missed <= MAX_PREDICTION_MISS * (cost - after))
            self.damping = max(self.damping * 30.0, 1e-5)
        return None

    @RUNAWAY
    def _missed(self, dx: Array, steps: Sequence[tuple[Array, float]], residuals: Sequence[Array]) -> float:
        """Squares of what the sensitivities did not foretell of a step."""
        out = 0.0
        for q, s, (start, bias), old, new in zip(
            self.parts, self.shots, steps, self.residuals, residuals, strict=True
        ):  # fmt: skip
            own = np.repeat(start, [b - a for a, b in s.edges], axis=0)
            change = q.columns @ dx + np.sum(q.state * own, axis=1) + bias
            out += float(np.sum((new - old + change)[s.weight] ** 2))
        return out if np.isfinite(out) else np.inf


class Step(NamedTuple):
    """A step taken: its largest part in standard errors, what it brought, of what, and whether as foretold."""

    length: float
    fall: float
    cost: float
    foretold: bool
