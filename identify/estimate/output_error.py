"""Output error: the model simulated, compared with what the sensor really measured.

Each run is simulated in shots. One shot over a whole run is the maximum-likelihood fit for white sensor
noise; shorter shots, each with a start state of its own, keep a model that is still wrong close to the
data (multiple shooting). Sensitivities are differences of simulations; start states, gyro bias and
global parameters are solved together, start states eliminated first (Gauss-Newton with Levenberg's damping).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from identify.model.parameters import Name, bounds_of, names_of, ordered, platform_of
from identify.model.structure import Structure
from identify.signals.trace import Trace
from identify.simulate.all_runs import shots_for
from identify.simulate.sensitivities import Reduced, at_residual, linearise
from identify.simulate.shots import RUNAWAY, Shots, moved, predict, residual_at
from rig import effects
from rig.dynamics import Equations
from rig.platform import Platform
from rig.recording.run import Array

ROBUST_FROM = 12  # shots: fewer show no outlier
OUTLIER = 4.0  # times the median error of a shot
KEPT = 3  # steps with the same sensitivities
FORETOLD = 0.1  # of the fall of the squares that sensitivities may miss to be kept


@dataclass(frozen=True)
class Estimate:
    """A fitted output-error model.

    Attributes
    ----------
    sigma
        Root mean square of measured minus simulated over the samples that count.
    information
        Normal matrix of the global parameters, start states and bias eliminated, for unit noise.
    work
        Fine steps that were simulated on the way, each parameter's sensitivity counted as a simulation.
    """

    structure: Structure
    names: tuple[Name, ...]
    values: Array
    sigma: float
    count: int
    information: Array
    shots: tuple[Shots, ...]
    converged: bool
    work: float = 0.0

    def platform(self, run: int = 0, added: float = 0.0) -> Platform:
        """The fitted platform, as it stood in one run."""
        return platform_of(self.structure, self.names, self.values, run, added)

    def simulated(self) -> list[Array]:
        """The measured channel as the model gives it, one array a run."""
        return [predict(s, Equations(self.platform(s.number, s.added)), s.starts, s.bias) for s in self.shots]

    def residuals(self) -> list[Array]:
        """Measured minus simulated, one array a run."""
        return [s.trace.measured - y for s, y in zip(self.shots, self.simulated(), strict=True)]


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


def refine(
    traces: Sequence[Trace],
    structure: Structure,
    start: Mapping[Name, float],
    shot_s: float | None = None,
    iterations: int = 12,
    use: Sequence[Any] | None = None,
    carry: Sequence[Shots] | None = None,
    fixed: Sequence[Name] = (),
    tolerance: float = 1e-4,
    coarse: bool = False,
    hopeless: float = np.inf,
    finer: int = 1,
    rests: bool = False,
) -> Estimate:
    """Fit all parameters of a structure by output error.

    Parameters
    ----------
    start
        A value for every parameter in ``names_of(structure)``.
    shot_s
        Length of a shot in seconds; None simulates each run in one go.
    use
        One boolean array a run: samples that count (None: all usable ones).
    carry
        Shots of an earlier estimate whose start states to begin from, where their layout agrees.
    fixed
        Parameters that stay at their start value.
    tolerance
        Stop when the sum of squares falls by less than this share of itself times 1e-2, or when no
        parameter moves by more than this many of its standard errors.
    coarse
        Half the fine steps: a hundredth of the noise, enough while models are compared.
    hopeless
        Give up after three iterations where the root mean square is still above this.
    finer
        That many times the fine steps.
    rests
        Runs that begin at rest are held to it: their start states are not fitted.
    """
    names = names_of(structure, 1 + max(t.number for t in traces))
    x = np.array([start.get(name, 0.0) if len(name) == 3 else start[name] for name in names])
    still = held_still(names, traces, use, fixed)
    shots = shots_for(traces, structure, names, x, shot_s, use, carry, coarse, finer, rests)
    workers = ThreadPoolExecutor(2)
    try:
        return _levenberg(_Descent(workers, shots, structure, names, x, still), iterations, tolerance, hopeless, coarse)
    finally:
        workers.shutdown()


def held_still(names: Sequence[Name], traces: Sequence[Trace], use: Sequence[Any] | None, fixed: Sequence[Name]) -> Any:
    """Which parameters keep their start value, (p,).

    Those asked for, shapes that the size of the motion gives, and what belongs to a run without a sample.
    """
    seen = {str(t.number) for i, t in enumerate(traces) if use is None or np.any(use[i])}
    held = {
        (e, p.name) for e in {n[0] for n in names if len(n) > 1} for p in effects.get(e).parameters if not p.searched
    }
    return np.array([name in fixed or name in held or (len(name) == 3 and name[2] not in seen) for name in names])


class _Descent:
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
        self.low = np.array([bounds_of(n)[0] for n in names])
        self.high = np.array([bounds_of(n)[1] for n in names])
        self.damping = 1e-6
        self.counts = np.concatenate([s.counts for s in shots])
        self.count = int(np.sum(self.counts))
        self.once = float(sum(s.grid.n for s in shots))  # fine steps of one simulation of every run
        self.work = self.once
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
        self.work += (1 + int(np.sum(~self.still)) + 2) * self.once
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
    def step(self) -> _Step | None:
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
            self.work += self.once
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
                return _Step(length, cost - after, cost, missed <= FORETOLD * (cost - after))
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


class _Step(NamedTuple):
    """A step taken: its largest part in standard errors, what it brought, of what, and whether as foretold."""

    length: float
    fall: float
    cost: float
    foretold: bool


def _levenberg(descent: _Descent, iterations: int, tolerance: float, hopeless: float, coarse: bool) -> Estimate:
    d, converged, left, age = descent, False, iterations, 0
    while left > 0 and not d.lost:
        if iterations - left >= 3 and d.cost > hopeless**2 * d.count:
            break
        step = d.step()
        left -= step is not None
        if step is None and d.fresh:
            converged = True
            break
        # Sensitivities from elsewhere lead beside the minimum, the further the more the model leaves.
        arrived = step is not None and _arrived(step, tolerance)
        age += 1
        if step is not None and d.fresh and arrived:
            converged = True
            d.keep() if coarse else d.renew()
            break
        if step is not None and step.foretold and not arrived and age <= KEPT:
            d.keep()
            continue
        age = 0
        d.renew()
    sigma = float(np.sqrt(d.cost / max(d.count, 1)))
    return Estimate(d.structure, d.names, d.x, sigma, d.count, d.a, tuple(d.shots), converged, d.work)


def _arrived(step: _Step, tolerance: float) -> bool:
    return step.length <= 30.0 * tolerance or step.fall < 1e-2 * tolerance * step.cost


def squares_at(
    traces: Sequence[Trace], structure: Structure, values: Mapping[Name, float], use: Sequence[Any], finer: int = 1
) -> float:  # fmt: skip
    """Sum of squares over whole runs at given parameters, start states and biases fitted by one step."""
    names = names_of(structure, 1 + max(t.number for t in traces))
    x = np.array([values.get(name, 0.0) if len(name) == 3 else values[name] for name in names])
    still = np.ones(len(x), dtype=bool)

    def of(s: Shots) -> float:
        part = linearise(s, structure, names, x, np.ones(len(x)), still, np.inf)
        found = [part.losses, residual_at(moved(s, part.back(np.zeros(len(x)))), structure, names, x)[1]]
        return min(float(np.sum(np.where(np.isfinite(each), each, np.inf))) for each in found)

    with ThreadPoolExecutor(2) as workers:
        return sum(workers.map(of, shots_for(traces, structure, names, x, None, use, None, True, finer)))
