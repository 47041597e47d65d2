"""The way down of a fit by prediction error: parameters, what each run has of its own, and noise in one step (scoring).

A parameter moves the innovations. A number of the noise moves them, too, through the gains, and moves their variance,
which tells as much about it as half a squared unit normal does (Fisher information of a variance). Both stand in one
normal matrix, damped as Levenberg did.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identify.estimate.output_error import held_still
from identify.likelihood.damped_step import LEVENBERG_DAMPING, step_down
from identify.likelihood.derivatives import GAIN_STEP, Derivatives, OperatingPoint, derivatives
from identify.likelihood.fit import Columns, Fit, Look, Prediction
from identify.likelihood.gyro_biases import settle_biases
from identify.likelihood.noise_grid import kinds_of_noise, noise_on_grid
from identify.likelihood.normal_equations import (
    COST_TOLERANCE,
    MAX_LOG_STEP,
    Floor,
    Step,
    level_of,
    normal_equations,
)
from identify.likelihood.other_noise import beside_another_noise, noise_alone, other_noise, without_disturbance
from identify.model.parameters import Name, bounds_of, names_of, ordered
from identify.model.structure import Structure
from identify.simulate.all_runs import shots_for
from identify.simulate.shots import RUNAWAY, Shots, with_bias
from rig import effects
from rig.arrays import Array
from rig.dynamics.gains import RATE, Noise
from rig.effects.base import Place

if TYPE_CHECKING:
    from identify.likelihood.prediction_error import PredictionError

DIFFERENCE_STEP = 1e-6  # relative step of the differences
COARSE_TOLERANCE = 5e-3  # of the difference to the model it is compared with, that the last step of a fit brings
STALLED_STEPS = 2  # steps in a row that bring little, after which a fit has arrived: one alone may have been cut short
EARLY_STEPS = 3  # steps after which a model that is right is near enough for it


class Descent:
    """From a start down to the nearest minimum of the cost.

    Parameters
    ----------
    problem
        The runs, and how they are predicted.
    start
        Values to begin from; what is missing begins at zero.
    noise
        To begin from; None looks for the best on a grid.
    carry
        Runs of an earlier fit, whose biases (and start states, where they are fitted) to begin from.
    fixed
        Parameters that stay at their start value.
    smooth
        Whether the grid has a smooth disturbance, a rough one, or both.
    stays
        It only looks from where a fit of the same runs stands, which ``carry`` is of.
    """

    def __init__(
        self, problem: PredictionError, structure: Structure, start: Mapping[Name, float], noise: Noise | None,
        carry: Sequence[Shots] | None, fixed: Sequence[Name], smooth: Sequence[bool] = (False, True),
        stays: bool = False,
    ) -> None:  # fmt: skip
        p = self.problem = problem
        self.structure, self.names = structure, names_of(structure, p.runs)
        self.x = np.array([start.get(n, 0.0) for n in self.names])
        self.low = np.array([bounds_of(n, self.names)[0] for n in self.names])
        self.high = np.array([bounds_of(n, self.names)[1] for n in self.names])
        self.x = ordered(self.names, np.clip(self.x, self.low, self.high))
        still = [*fixed, *([("inertia",)] if p.torque_free else [])]
        self.still = held_still(self.names, p.traces, p.use, still)
        self.scale = np.maximum(np.abs(self.x), [self._unit(n) for n in self.names])
        self.shots = list(carry or ()) if stays else self._runs()
        # Start states only where they are fitted: where a driven run begins stuck is up to the friction that is tried.
        if carry and not stays:
            self.shots = [with_bias(s, earlier.bias) for s, earlier in zip(self.shots, carry, strict=True)]
        for s, earlier in zip(self.shots, carry or (), strict=bool(carry)):
            if p.fits_starts and np.array_equal(earlier.first, s.first):
                s.starts = earlier.starts.copy()
        self.damping = self.noise_damping = LEVENBERG_DAMPING
        self.weights = [s.weight for s in self.shots]
        self.count = int(sum(w.sum() for w in self.weights)) * p.readings
        self.kinds = kinds_of_noise(p.bounds, structure)
        self.alone = noise is None or not self._begins(p.bounds.within(noise))  # nobody has looked for the noise yet
        if self.alone:
            self._begins(noise_on_grid(p.bounds, lambda q: self.cost_of(self.looks_at(self.x, q, self.shots)), smooth))
        if not stays:
            settle_biases(self)
        if self.alone and not structure.acts_on_motion:  # else every look is a prediction
            noise_alone(self)
        self.information: Array = np.zeros((len(self.x), len(self.x)))
        self._informed: tuple[Noise, bytes] | None = None

    def _runs(self) -> list[Shots]:
        p = self.problem
        return shots_for(p.traces, self.structure, self.names, self.x, None, p.use, None, p.coarse, ahead=True)

    def _begins(self, noise: Noise) -> bool:
        """Begin from a noise; False where the prediction runs away with it."""
        self.noise, self.looks = noise, self.looks_at(self.x, noise, self.shots)
        self.cost = self.cost_of(self.looks)
        return bool(np.isfinite(self.cost))

    def _unit(self, name: Name) -> float:
        """What changes the torque by about itself: the scale of a parameter that is zero."""
        p = self.problem
        if len(name) == 1:
            per = {"inertia": p.acceleration, "damping": p.rate_rad_s, "stiffness": p.angle_rad}[name[0]]
            return p.torque_nm / per
        parameter = next(q for q in effects.get(name[0]).parameters if q.name == name[1])
        if parameter.linear:
            return 1e-3 * p.torque_nm if parameter.unit.startswith("N") else 1e-3
        return p.step_s if parameter.unit == "s" else 1e-3

    @property
    def sticks(self) -> bool:
        """Whether the model has dry friction."""
        return any(effects.get(e).place is Place.FRICTION for e in self.structure.effects)

    def minimise(self, steps: int, thorough: bool, against: float | None = None, least: float = np.inf) -> int:
        """Steps until it has arrived; how many are left. A thorough fit then looks at other noises.

        ``against`` is the cost of the model that it is compared with: then it need not arrive closer than to a small
        share of the difference. ``least`` is the cost that it must be below once models that are right are near it.
        """
        looked, idle = False, 0
        for left in range(steps, 0, -1):
            before, damping = self.cost, self.damping
            if steps - left == EARLY_STEPS:
                without_disturbance(self)
                if self.cost > least:
                    return left
            enough = 0.0 if against is None else COARSE_TOLERANCE * max(against - self.cost, 0.0)
            moved = self.step(enough)
            # Along a valley damping holds a step short; where it was right to be taken, the next one is longer.
            idle = 0 if before - self.cost > enough else idle + (not self.damping < damping)
            if moved and idle < STALLED_STEPS:
                continue
            early = steps - left < EARLY_STEPS and not (looked or thorough)
            if early and self.cost <= least and beside_another_noise(self):
                looked, idle = True, 0
                continue
            if left == 1 or not thorough or not other_noise(self, lower=not looked):
                return left - 1
            looked = True
        return 0

    def step(self, enough: float = 0.0) -> bool:
        """One step down; False where it has arrived to within ``enough``, or none leads there."""
        before = self.cost
        return bool(np.isfinite(before)) and self.try_step(True, enough) and before - self.cost > COST_TOLERANCE

    def columns(self) -> list[Columns]:
        """Derivatives of every run."""
        return [d.columns for d in self._derivatives(False, False)]

    def scores(self) -> list[Columns]:
        """The same with what the parameters do through the gains, and to the variance of the innovations."""
        parts = self._derivatives(False, True)
        variance, level = level_of(parts, self.count, self.floor(()))
        return [d.with_variance(level, variance) for d in parts]

    def looks_at(self, x: Array, noise: Noise, shots: Sequence[Shots]) -> list[Look]:
        """Every run predicted elsewhere."""
        p = self.problem
        return list(p.workers.map(lambda s: p.look(s, self.structure, self.names, x, noise), shots))

    @RUNAWAY
    def cost_of(self, looks: Sequence[Look]) -> float:
        """Minus twice the log-likelihood of such predictions; infinite where they run away."""
        squares = self._squares(looks)
        if not np.isfinite(squares) or squares <= 0.0:
            return np.inf
        log = sum(float(np.sum(np.log(q.variance[w]))) for q, w in zip(looks, self.weights, strict=True))
        variance = max(squares / max(self.count, 1), looks[0].floor)
        return float(self.count * (np.log(variance) - 1.0) + squares / variance + log)

    def _squares(self, looks: Sequence[Look]) -> float:
        both = zip(looks, self.weights, strict=True)
        return sum(float(np.sum(q.innovations[w] ** 2 / q.variance[w])) for q, w in both)

    def _derivatives(self, of_noise: bool, of_gains: bool) -> list[Derivatives]:
        """Every run's derivatives, where the descent stands."""
        free = [k for k in range(len(self.names)) if not self.still[k]]

        def steps(relative: float, places: Sequence[int]) -> dict[int, float]:
            size = relative * self.scale * np.where(self.x + relative * self.scale > self.high, -1.0, 1.0)
            return {k: float(size[k]) for k in places}

        shaping = [k for k in free if of_gains and self._shapes_gains(self.names[k])]
        return derivatives(
            self._operating_point(),
            steps(DIFFERENCE_STEP, free),
            self.kinds if of_noise else [],
            steps(GAIN_STEP, shaping),
        )

    def _operating_point(self) -> OperatingPoint:
        return OperatingPoint(self.problem, self.structure, self.names, self.x, self.noise, self.shots, self.looks)

    @staticmethod
    def _shapes_gains(name: Name) -> bool:
        """Whether a parameter is one of the linear part or of the sensor: what others do to the gains is little."""
        return len(name) == 1 or effects.get(name[0]).lag is not None or effects.get(name[0]).has_linear_states

    def _solvable(self, of_noise: bool, of_gains: bool = True) -> Step:
        """The normal equations where the descent stands; the information of the parameters is kept."""
        kinds = len(self.kinds) if of_noise else 0
        parts = self._derivatives(of_noise, of_gains)
        found = normal_equations(parts, len(self.x), kinds, self.count, self.floor(self.kinds[:kinds]))
        self.information, self._informed = found.information, (self.noise, self.x.tobytes())
        return found

    def of_noise(self) -> Step:
        """The normal equations of the noise and the runs' own unknowns, where the descent stands."""
        parts = derivatives(self._operating_point(), {}, self.kinds)
        return normal_equations(parts, len(self.x), len(self.kinds), self.count, self.floor(self.kinds))

    def floor(self, kinds: Sequence[str]) -> Floor:
        """The least variance of one reading where the descent stands, and what parameters and noise do to it."""
        p, here, fall = self.problem, self.looks[0].floor, np.zeros(len(self.x) + len(kinds))
        lags = [k for k, n in enumerate(self.names) if len(n) > 1 and effects.get(n[0]).lag is not None]

        def falls(x: Array, noise: Noise) -> float:
            return float(np.log(here / p.floor_at(self.shots[0], self.structure, self.names, x, noise)))

        for k in lags:
            there = self.x.copy()
            there[k] += (step := DIFFERENCE_STEP * self.scale[k])
            fall[k] = falls(there, self.noise) / step
        if lags and "ahead" in kinds:
            more = replace(self.noise, ahead=self.noise.ahead * float(np.exp(DIFFERENCE_STEP)))
            fall[len(self.x) + list(kinds).index("ahead")] = falls(self.x, more) / DIFFERENCE_STEP
        return Floor(here, fall)

    def try_step(self, of_noise: bool, enough: float = 0.0) -> bool:
        """One step of parameters, biases and, if asked for, the noise; False where none leads down by ``enough``."""
        return step_down(self, self._solvable(of_noise), of_noise, enough)

    def room(self, kinds: int) -> tuple[Array, Array]:
        """How far parameters and numbers of the noise may be stepped down and up, (p + k,) each."""
        down, up = self.low - self.x, self.high - self.x
        down[self.still] = up[self.still] = 0.0
        least, most = self.problem.bounds.extremes(self.noise, self.kinds[:kinds])
        fall = np.maximum(np.log(least), -MAX_LOG_STEP)
        return np.append(down, fall), np.append(up, most - 1.0)  # what rises is stepped as a density (``logs_of``)

    def with_logs(self, change: Array) -> Noise:
        times = zip(self.kinds, np.exp(change).tolist(), strict=False)
        return self.problem.bounds.within(replace(self.noise, **{k: getattr(self.noise, k) * x for k, x in times}))

    def place(self) -> tuple[Noise, Array, list[Shots], list[Look], float]:
        """Where it stands, to go back to."""
        return self.noise, self.x, self.shots, self.looks, self.cost

    def go(self, place: tuple[Noise, Array, list[Shots], list[Look], float]) -> None:
        """Back to a place."""
        self.noise, self.x, self.shots, self.looks, self.cost = place

    def reduced_chi_square(self) -> float:
        """Median over the samples of the prediction's variance over that without a torque disturbance.

        A gyro's walk is left out, too: beside a wrong model it takes what is torque, and would hide it here.
        """
        p, quiet = self.problem, replace(self.noise, white=0.0, slow=0.0, smooth=0.0)
        quiet = replace(quiet, walk=0.0) if p.gyro else quiet
        ratios = [
            (q.variance[w] / p.gains_at(s, self.structure, self.names, self.x, quiet).variance[w])[:, -1]
            for s, q, w in zip(self.shots, self.looks, self.weights, strict=True)
        ]  # fmt: skip
        return float(np.median(np.concatenate(ratios)))

    def found(self) -> Fit:
        """The fit where the descent stands."""
        if self._informed != (self.noise, self.x.tobytes()):
            self._solvable(False, False)
        inertia = self.x[self.names.index(("inertia",))] if ("inertia",) in self.names else 1.0
        disturbance = [
            q.state[:, 2]
            + (inertia + s.added) * np.sum(q.gains.gain[:, :, RATE] * q.innovations, axis=1) / s.trace.step_s
            for q, s in zip(self.looks, self.shots, strict=True)
        ]  # fmt: skip
        wrong, spread = [q.innovations for q in self.looks], [q.variance for q in self.looks]
        variance = max(self._squares(self.looks) / max(self.count, 1), self.looks[0].floor)
        costs = [np.sum(q.innovations**2 / (v := q.variance * variance) + np.log(v), axis=1) for q in self.looks]
        return Fit(
            self.structure, self.names, self.x, self.count, variance, self.cost, self.information, self.noise,
            tuple(self.shots), Prediction(wrong, spread, costs, disturbance), self.reduced_chi_square(),
        )  # fmt: skip
