"""Prediction error: the maximum-likelihood fit for sensor noise and a torque disturbance at once.

Each reading is predicted from those before it (see ``rig.dynamics.predictor``). Without a disturbance that is output
error over whole runs; with a large one it is equation error; the data choose the ratio, which is fitted beside the
parameters. While an effect is missing from the model its torque counts as disturbance, the prediction leans on the
measurements, and the error has no false minima; as effects are found the disturbance shrinks and the estimate sharpens.

Sources: Ljung, System Identification, ch. 7; Kristensen, Madsen and Jorgensen, Automatica 40 (2004).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimate.fit import Fit, Prediction
from identify.estimate.output_error import held_still, shots_for
from identify.model.parameters import Name, bounds_of, equations_of, names_of, ordered
from identify.model.structure import Structure
from identify.signals.trace import Trace
from identify.simulate.shots import RUNAWAY, Shots
from rig import effects
from rig.arrays import Array
from rig.dynamics.predictor import Gains, Noise, gains_of, predict_ahead
from rig.effects.base import Place

STEP = 1e-6  # relative step of the differences
STRIDE, SHORTEST_STRIDE, LONGEST_STRIDE = 1.5, 0.2, 7.0  # of the logarithms of the noise's three numbers
GROWTH, SHRINKAGE = 2.5, 0.5  # of a stride that led down, and of one that did not
LONGEST_SHARE = 0.2  # of the longest run: a disturbance slower than that is a constant
SHORTEST_SAMPLES = 4.0  # time constant of a disturbance, in samples: a faster one is white
LEAST_TORQUE, MOST_TORQUE = 1e-7, 10.0  # of the torque: how large a disturbance may be
ENOUGH = 0.5  # fall of the cost below which a fit has arrived
DOWN = (1e-3, 1e-6, 1e-10)  # times the disturbance: how far below a model is looked at with parameters that follow
FAR = 2.0  # times the sensor's variance: less of a disturbance is found step by step
DIRECTIONS = ((1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # in which a noise is looked for
FURTHER = (  # times white density, slow variance and time constant: where else a noise is looked for
    (0.01, 1.0, 1.0), (0.1, 1.0, 1.0), (10.0, 1.0, 1.0), (1.0, 0.01, 1.0), (1.0, 0.1, 1.0), (1.0, 10.0, 1.0),
    (1.0, 0.1, 0.1), (1.0, 1.0, 0.1), (1.0, 0.03, 0.01), (1.0, 1.0, 10.0),
)  # fmt: skip
# Of the motion, root mean square, by which a start state may be off: the smoothed motion is worst where a run begins.
START_RATE, START_ANGLE, UNKNOWN_ANGLE = 0.1, 0.05, 1.0
KEPT_GAINS = 4  # of a run
TRIALS = 7  # step lengths tried before a direction is given up


@dataclass(frozen=True)
class Columns:
    """One run's derivatives at a fit, of the samples that count.

    Attributes
    ----------
    columns
        What the parameters do to the scaled innovations, (n, p).
    bias
        What the run's bias does, (n,); zeros where it has none.
    scaled
        Innovations over their standard deviation, (n,).
    variance
        Of the innovations, (n,).
    """

    columns: Array
    bias: Array
    scaled: Array
    variance: Array


@dataclass(frozen=True)
class Look:
    """One run's innovations at a parameter vector."""

    innovations: Array
    variance: Array
    state: Array  # angle, rate, slow torque after each sample, (n, 3)
    gain: Array


class PredictionError:
    """Fits structures to a set of runs, all by the same likelihood.

    Parameters
    ----------
    traces
        The runs, prepared.
    use
        One boolean array a run: samples that count (None: all usable ones). The others are still measured.
    coarse
        Half the fine steps in a simulation: enough while models are compared.
    """

    def __init__(self, traces: Sequence[Trace], use: Sequence[Any] | None = None, coarse: bool = True) -> None:
        self.traces, self.use, self.coarse = list(traces), use, coarse
        self.runs = 1 + max(t.number for t in traces)
        self.torque_free = all(t.torque is None for t in traces)
        motion = [t.fine for t in traces]
        self.angle_rad = _rms([x[0] - np.mean(x[0]) for x in motion])
        self.rate_rad_s = _rms([x[1] for x in motion])
        self.acceleration = _rms([np.gradient(x[1], x[2]) for x in motion])
        self.torque_nm = self.acceleration if self.torque_free else _rms([x[3] for x in motion])
        self.reading_variance = float(np.mean([t.noise**2 for t in traces]))
        self.step_s = float(np.median([t.step_s for t in traces]))
        longest = max(t.step_s * len(t.measured) for t in traces)
        self.slowest_s = max(LONGEST_SHARE * longest, 10.0 * SHORTEST_SAMPLES * self.step_s)
        self.workers = ThreadPoolExecutor(2)
        self._most_white = MOST_TORQUE
        self._gains: dict[int, dict[tuple[object, ...], Gains]] = {}

    @RUNAWAY
    def cost_at(self, fit: Fit, noise: Noise) -> float:
        """The cost of a fit with another noise."""
        squares, logs = 0.0, 0.0
        for s in fit.shots:
            look = self.look(s, fit.structure, fit.names, fit.vector, noise, s.bias)
            squares += float(np.sum(look.innovations[s.weight] ** 2 / look.variance[s.weight]))
            logs += float(np.sum(np.log(look.variance[s.weight])))
        return fit.count * float(np.log(squares / fit.count)) + logs if np.isfinite(squares) else np.inf

    def columns_at(self, fit: Fit) -> list[Columns]:
        """Derivatives of every run's innovations where a fit stands."""
        with np.errstate(all="ignore"):
            descent = _Descent(self, fit.structure, fit.values, fit.noise, fit.shots, ())
            return descent.columns()

    def white(self, share: float) -> float:
        """Density of a white torque that is this share of the torque, as ``Noise`` has it."""
        return (share * self.torque_nm) ** 2 * 2.0 * self.step_s / self.reading_variance

    def slow(self, share: float) -> float:
        """Variance of a slow torque that is this share of the torque, as ``Noise`` has it."""
        return (share * self.torque_nm) ** 2 / self.reading_variance

    def within(self, noise: Noise) -> Noise:
        """The nearest noise that is neither absurdly large nor without effect."""
        return Noise(
            float(np.clip(noise.white, self.white(LEAST_TORQUE), self.white(self._most_white))),
            float(np.clip(noise.slow, self.slow(LEAST_TORQUE), self.slow(MOST_TORQUE))),
            float(np.clip(noise.time_constant_s, SHORTEST_SAMPLES * self.step_s, self.slowest_s)),
        )

    def fit(
        self, structure: Structure, start: Mapping[Name, float], noise: Noise | None = None, iterations: int = 25,
        carry: Sequence[Shots] | None = None, fixed: Sequence[Name] = (), most_white: float = MOST_TORQUE,
    ) -> Fit:  # fmt: skip
        """Fit all parameters of a structure together with the noise.

        Parameters
        ----------
        start
            Values to begin from; what is missing begins at zero.
        noise
            To begin from; None looks for the best on a grid.
        carry
            Runs of an earlier fit, whose biases to begin from.
        fixed
            Parameters that stay at their start value.
        most_white
            Of the torque, that a white disturbance may be.
        """
        self._most_white = most_white
        with np.errstate(all="ignore"):
            descent = _Descent(self, structure, start, noise, carry, fixed)
            left = descent.down(iterations)
            while left > 0 and descent.sticks:  # where a run begins stuck is another place with another friction
                values = dict(zip(descent.names, descent.x.tolist(), strict=True))
                again = _Descent(self, structure, values, descent.noise, descent.found().shots, fixed)
                left = again.down(left)
                if not again.cost < descent.cost - ENOUGH:
                    break
                descent = again
            return descent.found()

    @RUNAWAY
    def look(self, s: Shots, structure: Structure, names: Sequence[Name], x: Array, noise: Noise, bias: float) -> Look:
        """One run predicted at a parameter vector."""
        equations = equations_of(structure, names, x, s.number, s.added)
        trace = s.trace
        lag_s = float(sum(v[0] for v in equations.sensor.values))
        rate = trace.channel == "rate"
        spans = [(a, b - 1) for a, b in s.edges]
        gains = self._gains_of(s, equations.jck, noise, lag_s, spans)
        predicted, state = predict_ahead(
            equations, s.grid.shaft_torque(equations), s.grid.step_s, round(trace.step_s / s.grid.step_s), spans,
            s.starts, trace.measured, trace.keep, gains, rate, bias, trace.offset_s, trace,
        )  # fmt: skip
        return Look(trace.measured - predicted, gains.variance, state, gains.gain)

    def _gains_of(self, s: Shots, jck: Array, noise: Noise, lag_s: float, spans: list[tuple[int, int]]) -> Gains:
        """A run's gains; the last few are kept, because most looks change an effect and not the linear part."""
        trace = s.trace
        kept = self._gains.setdefault(trace.number, {})
        key = (*jck.tolist(), noise, lag_s, id(trace), *spans)
        found = kept.get(key)
        if found is None:
            found = gains_of(
                jck, noise, trace.step_s, trace.channel == "rate", lag_s, trace.keep, spans, self.start_variance(trace)
            )  # fmt: skip
            for old in list(kept)[: max(0, len(kept) + 1 - KEPT_GAINS)]:
                kept.pop(old, None)
            kept[key] = found
        return found

    def start_variance(self, trace: Trace) -> tuple[float, float]:
        """Of angle and rate at the start of a stretch, read off the smoothed motion; over that of one reading."""
        rate = (2.0 * trace.fine[4]) ** 2 + (START_RATE * self.rate_rad_s) ** 2
        known = trace.channel == "angle"
        angle = 4.0 * trace.noise**2 + ((START_ANGLE if known else UNKNOWN_ANGLE) * self.angle_rad) ** 2
        return angle / self.reading_variance, rate / self.reading_variance

    def on_grid(self, cost: Callable[[Noise], float]) -> Noise:
        """The best of a coarse grid of noises: white alone first, then a slow part beside it."""
        tau = np.geomspace(20.0 * self.step_s, 0.3 * self.slowest_s, 3).tolist()
        little = self.slow(1e-6)
        best = min(
            (Noise(self.white(share), little, tau[1]) for share in (1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6)), key=cost
        )
        slow = [
            Noise(best.white * w, self.slow(share), t) for t in tau for share in (0.3, 0.03, 0.003) for w in (1.0, 0.05)
        ]
        return min((best, *slow), key=cost)


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean([float(np.mean(x * x)) for x in parts]))) + 1e-300


class _Descent:
    """Gauss-Newton with Levenberg's damping over parameters, noise and biases of the runs."""

    def __init__(
        self, problem: PredictionError, structure: Structure, start: Mapping[Name, float], noise: Noise | None,
        carry: Sequence[Shots] | None, fixed: Sequence[Name],
    ) -> None:  # fmt: skip
        p = self.problem = problem
        self.structure, self.names = structure, names_of(structure, p.runs)
        self.x = np.array([start.get(n, 0.0) for n in self.names])
        self.low = np.array([bounds_of(n)[0] for n in self.names])
        self.high = np.array([bounds_of(n)[1] for n in self.names])
        self.x = ordered(self.names, np.clip(self.x, self.low, self.high))
        still = [*fixed, *([("inertia",)] if p.torque_free else [])]
        self.still = held_still(self.names, p.traces, p.use, still)
        self.scale = np.maximum(np.abs(self.x), [self._unit(n) for n in self.names])
        self.shots = shots_for(p.traces, structure, self.names, self.x, None, p.use, None, p.coarse)
        # Start states are not carried over: where a run begins stuck is a matter of the friction that is tried.
        self.bias: Array = np.array([s.bias for s in (carry or self.shots)])
        self.damping = 1e-4
        self.weights = [s.weight for s in self.shots]
        self.count = int(sum(w.sum() for w in self.weights))
        self.noise = p.within(noise or p.on_grid(lambda q: self._cost(self._looks(self.x, p.within(q), self.bias))))
        self.looks = self._looks(self.x, self.noise, self.bias)
        self.cost = self._cost(self.looks)
        self.information: Array = np.zeros((len(self.x), len(self.x)))
        self._calm = 0
        self._ways, self._strides = [-1.0, -1.0, -1.0, 1.0], np.full(len(DIRECTIONS), STRIDE)

    def _unit(self, name: Name) -> float:
        """What changes the torque by about itself: the scale of a parameter that is zero."""
        p = self.problem
        if len(name) == 1:
            per = {"inertia": p.acceleration, "damping": p.rate_rad_s, "stiffness": p.angle_rad}[name[0]]
            return p.torque_nm / per
        parameter = next(q for q in effects.get(name[0]).parameters if q.name == name[1])
        return 1e-3 * p.torque_nm if parameter.linear and parameter.unit.startswith("N") else 0.0

    def _looks(self, x: Array, noise: Noise, bias: Array) -> list[Look]:
        p = self.problem
        return list(
            p.workers.map(lambda i: p.look(self.shots[i], self.structure, self.names, x, noise, float(bias[i])),
                          range(len(self.shots)))
        )  # fmt: skip

    @RUNAWAY
    def _cost(self, looks: Sequence[Look]) -> float:
        squares = sum(
            float(np.sum(q.innovations[w] ** 2 / q.variance[w])) for q, w in zip(looks, self.weights, strict=True)
        )
        if not np.isfinite(squares) or squares <= 0.0:
            return np.inf
        log = sum(float(np.sum(np.log(q.variance[w]))) for q, w in zip(looks, self.weights, strict=True))
        return float(self.count * np.log(squares / self.count) + log)

    @RUNAWAY
    def _columns(self, i: int) -> Columns:
        """Derivatives of one run's scaled innovations, where the descent stands."""
        p, s, base, w = self.problem, self.shots[i], self.looks[i], self.weights[i]
        root = np.sqrt(base.variance[w])
        scaled = base.innovations[w] / root
        columns, ones = np.zeros((len(scaled), len(self.x))), np.zeros(len(scaled))
        for k, name in enumerate(self.names):
            if self.still[k] or (len(name) == 3 and int(name[2]) != s.number):
                continue
            h = STEP * self.scale[k] * (-1.0 if self.x[k] + STEP * self.scale[k] > self.high[k] else 1.0)
            moved = self.x.copy()
            moved[k] += h
            other = p.look(s, self.structure, self.names, moved, self.noise, self.bias[i])
            columns[:, k] = -(other.innovations[w] - base.innovations[w]) / h / root
        if s.trace.biased:
            h = 1e-4 * p.rate_rad_s
            other = p.look(s, self.structure, self.names, self.x, self.noise, self.bias[i] + h)
            ones = -(other.innovations[w] - base.innovations[w]) / h / root
        return Columns(columns, ones, scaled, base.variance[w])

    @property
    def sticks(self) -> bool:
        """Whether the model has dry friction."""
        return any(effects.get(e).place is Place.FRICTION for e in self.structure.effects)

    def down(self, steps: int) -> int:
        """Steps until it has arrived; how many are left."""
        for left in range(steps, 0, -1):
            if not self.step() and (left == 1 or not self.other_noise()):
                return left - 1
        return 0

    def columns(self) -> list[Columns]:
        """Derivatives of every run, where the descent stands."""
        return list(self.problem.workers.map(self._columns, range(len(self.shots))))

    def step(self) -> bool:
        """One step down; False where it has arrived, or none leads there."""
        if not np.isfinite(self.cost):
            return False
        before = self.cost
        moved = self._parameters_down()
        settled = self._noise_down()
        self._calm = self._calm + 1 if before - self.cost < ENOUGH and (settled or not moved) else 0
        return self._calm < 2 and (moved or before - self.cost > 0.0 or not settled)

    def _parameters_down(self) -> bool:
        """One step of parameters and biases, the noise held."""
        p = len(self.x)
        a, b = np.zeros((p, p)), np.zeros(p)
        biases = []
        for part in self.columns():
            wide, z, one = part.columns, part.scaled, part.bias
            pivot = float(one @ one)
            across, own = (one @ wide / pivot, float(one @ z) / pivot) if pivot > 0.0 else (np.zeros(p), 0.0)
            a += wide.T @ wide - pivot * np.outer(across, across)
            b += wide.T @ z - pivot * across * own
            biases.append((across, own))
        if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
            return False
        self.information = a
        size: Array = np.sqrt(np.maximum(np.diag(a), 1e-300))
        free = ~self.still & (np.diag(a) > 0.0)
        scaled, right_side = (a / np.outer(size, size))[np.ix_(free, free)], (b / size)[free]
        for _ in range(TRIALS):
            d = np.zeros(p)
            d[free] = np.linalg.lstsq(scaled + self.damping * np.eye(len(right_side)), right_side, rcond=1e-14)[0]
            x = ordered(self.names, np.clip(self.x + d / size, self.low, self.high))
            bias = self.bias + np.array([own - share @ (x - self.x) for share, own in biases])
            looks = self._looks(x, self.noise, bias)
            cost = self._cost(looks)
            if cost < self.cost:
                self.x, self.bias, self.looks, self.cost = x, bias, looks, cost
                self.damping = max(self.damping / 10.0, 1e-9)
                return True
            self.damping = max(10.0 * self.damping, 1e-3)
        return False

    def _noise_down(self) -> bool:
        """One step along each of the noise's logarithms; True where none is left that matters.

        Parameters and noise are all but independent in this likelihood, and a look at another noise costs one
        prediction.
        """
        for k, direction in enumerate(DIRECTIONS):
            for way in (self._ways[k], -self._ways[k]):
                logs = np.log(_three(self.noise)) + way * self._strides[k] * np.array(direction)
                noise = self.problem.within(Noise(*np.exp(logs).tolist()))
                if noise == self.noise:
                    continue
                looks = self._looks(self.x, noise, self.bias)
                cost = self._cost(looks)
                if cost < self.cost - 0.1 * ENOUGH:
                    self.noise, self.looks, self.cost = noise, looks, cost
                    self._ways[k], self._strides[k] = way, min(GROWTH * self._strides[k], LONGEST_STRIDE)
                    break
            else:
                self._strides[k] = max(SHRINKAGE * self._strides[k], SHORTEST_STRIDE)
        return bool(np.all(self._strides <= 2.0 * SHORTEST_STRIDE))

    def other_noise(self) -> bool:
        """Whether a noise that is quite another one is likelier; if so the descent goes on from there.

        Beside the right one the likelihood is a quadratic in its logarithms; far off it is flat, or has a valley for
        a disturbance that is slow and another for one that is fast. A model that is nearly right shows what it can do
        without a disturbance only once its parameters have followed.
        """
        before = self.cost
        for factors in FURTHER:
            noise = self.problem.within(Noise(*(a * f for a, f in zip(_three(self.noise), factors, strict=True))))
            looks = self._looks(self.x, noise, self.bias)
            cost = self._cost(looks)
            if cost < self.cost - ENOUGH:
                self.noise, self.looks, self.cost = noise, looks, cost
        here = self._place()
        if (
            float(np.median(np.concatenate([q.variance[w] for q, w in zip(self.looks, self.weights, strict=True)])))
            > FAR
        ):
            for factor in DOWN:
                self._go(here)
                self.noise = self.problem.within(
                    Noise(factor * here[0].white, factor * here[0].slow, here[0].time_constant_s)
                )
                self.looks = self._looks(self.x, self.noise, self.bias)
                self.cost, self.damping = self._cost(self.looks), 1e-4
                if not (self._parameters_down() and self._parameters_down() and self.cost < here[-1] - ENOUGH):
                    self._go(here)
                here = self._place()
        self._calm, self._strides = 0, np.full(len(DIRECTIONS), STRIDE)
        return self.cost < before - ENOUGH

    def _place(self) -> tuple[Noise, Array, Array, list[Look], float]:
        return self.noise, self.x, self.bias, self.looks, self.cost

    def _go(self, place: tuple[Noise, Array, Array, list[Look], float]) -> None:
        self.noise, self.x, self.bias, self.looks, self.cost = place

    def found(self) -> Fit:
        """The fit where the descent stands."""
        squares = sum(
            float(np.sum(q.innovations[w] ** 2 / q.variance[w])) for q, w in zip(self.looks, self.weights, strict=True)
        )
        shots = tuple(replace_bias(s, float(b)) for s, b in zip(self.shots, self.bias, strict=True))
        inertia = self.x[self.names.index(("inertia",))] if ("inertia",) in self.names else 1.0
        disturbance = [
            q.state[:, 2] + (inertia + s.added) * q.gain[:, 1] * q.innovations / s.trace.step_s
            for q, s in zip(self.looks, self.shots, strict=True)
        ]
        prediction = Prediction([q.innovations for q in self.looks], [q.variance for q in self.looks], disturbance)
        return Fit(
            self.structure, self.names, self.x, self.noise, shots, self.cost, self.count,
            squares / max(self.count, 1), self.information, prediction,
        )  # fmt: skip


def _three(noise: Noise) -> tuple[float, float, float]:
    return noise.white, noise.slow, noise.time_constant_s


def replace_bias(s: Shots, bias: float) -> Shots:
    """The same run with another bias."""
    return Shots(s.trace, s.grid, s.first, s.starts, bias, s.weight, s.rests)
