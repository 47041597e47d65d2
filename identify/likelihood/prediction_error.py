"""Prediction error: the maximum-likelihood fit for sensor noise and a torque disturbance at once.

Each reading is predicted from those before it (see ``rig.dynamics.predictor``). Without a disturbance that is output
error over whole runs; with a large one it is equation error; the data choose the ratio, which is fitted beside the
parameters. While an effect is missing from the model its torque counts as disturbance, the prediction leans on the
measurements, and the error has no false minima; as effects are found the disturbance shrinks and the estimate sharpens.

Sources: Ljung, System Identification, ch. 7; Kristensen, Madsen and Jorgensen, Automatica 40 (2004).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from threading import Lock
from typing import Any

import numpy as np

from identify.likelihood.descent import Descent
from identify.likelihood.fit import Columns, Fit, Look
from identify.likelihood.kept_gains import KeptGains
from identify.likelihood.noise_bounds import NoiseBounds
from identify.likelihood.normal_equations import COST_TOLERANCE
from identify.likelihood.settling import settled
from identify.likelihood.workers import Workers
from identify.model.parameters import Name, equations_of
from identify.model.structure import Structure
from identify.signals.trace import MOST_BIAS_RAD_S, Trace
from identify.simulate.mean_slopes import mean_slopes
from identify.simulate.shots import RUNAWAY, Shots, begins_at_rest
from rig import effects
from rig.arrays import Array
from rig.dynamics.equations import Equations
from rig.dynamics.gains import Gains, Noise, Sensing, StartVariance
from rig.dynamics.linear_part import LinearPart, linear_part
from rig.dynamics.predictor import predict_ahead

# Of the motion, root mean square, by which a start state may be off: the smoothed motion is worst where a run begins.
START_RATE, START_ANGLE, UNKNOWN_ANGLE = 0.1, 0.05, 1.0
LONG_RUN_SAMPLES = 10_000  # of a run: two threads predict such runs sooner than one
# Of what the readings show above the motion: the sensor's noise is no smaller; nor than the other where motion reaches
# up there and is read for noise, for beside a sensor without any noise all is disturbance.
LEAST_VARIANCE, LEAST_UNREAD_VARIANCE = 0.5, 0.01
SLOPE_CACHE_SIZE = 100  # of effects, along all runs


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
        self.traces, self.use, self.coarse = list(traces), settled(traces, use), coarse
        self.runs = 1 + max(t.number for t in traces)
        self.torque_free = all(t.torque is None for t in traces)
        motion = [t.fine for t in traces]
        self.angle_rad = _rms([x[0] - np.mean(x[0]) for x in motion])
        self.rate_rad_s = _rms([x[1] for x in motion])
        self.acceleration = _rms([np.gradient(x[1], x[2]) for x in motion])
        self.torque_nm = self.acceleration if self.torque_free else _rms([x[3] for x in motion])
        self.both = all(t.beside is not None for t in traces)
        self.gyro = self.both or any(t.channel == "rate" for t in traces)
        self.readings = 2 if self.both else 1
        self.reading_variance = float(np.mean([self._noises(t)[0] ** 2 for t in traces]))
        _, noisy = min(t.upper_spectrum for t in traces)  # of the quietest run, whose noise is taken for all
        least = LEAST_VARIANCE if noisy else LEAST_UNREAD_VARIANCE
        self.least_variance = least * self.reading_variance
        self.step_s = float(np.median([t.step_s for t in traces]))
        longest = self.longest_s = max(t.step_s * len(t.measured) for t in traces)
        # A gyro's bias walks. An encoder's error (its eccentricity, stamps that wander) does, too, but matters only
        # where a small friction is to be seen in how a long decay keeps its phase.
        self.wanders = self.gyro or self.torque_free
        self.bounds = NoiseBounds(
            self.torque_nm, self.rate_rad_s if self.gyro else self.angle_rad, self.step_s, longest,
            self.reading_variance, self.gyro, self.wanders,
        )  # fmt: skip
        self.workers = Workers(traces, threads=longest > LONG_RUN_SAMPLES * self.step_s)
        self._slopes: dict[tuple[object, ...], LinearPart] = {}
        self._slopes_lock = Lock()
        # A decay shows nothing but how it began and how it swings on, far beyond what is linear about its prediction:
        # where it began is fitted, and not corrected as the readings come in.
        self.fits_starts = self.torque_free
        self._begun = StartVariance() if self.fits_starts else self._start_variance()
        alone = all(t.channel == "rate" for t in traces) and not self.both
        self._begins_at_zero = alone and all(begins_at_rest(t) and len(t.stretches) == 1 for t in traces)
        self._gains = KeptGains(self.step_s, max(len(t.measured) for t in traces))

    def floor_of(self, lag: tuple[float, float], noise: Noise) -> float:
        """Least variance of one reading: no sensor is far better than the end of its spectrum shows.

        What a gyro's low-pass lets through of the noise ahead of it shows there, too. Beside an encoder, whose noise
        goes with that of the gyro, it does not count.
        """
        return self.least_variance / (1.0 if self.both else self.bounds.shown_above(noise, lag))

    def columns_at(self, fit: Fit, with_variance: bool = False) -> list[Columns]:
        """Derivatives of every run's innovations where a fit stands; ``with_variance``, of their whole likelihood."""
        with np.errstate(all="ignore"):
            here = all(s.trace is t for s, t in zip(fit.shots, self.traces, strict=True))
            descent = Descent(self, fit.structure, fit.values, fit.noise, fit.shots, (), stays=here)
            return descent.scores() if with_variance else descent.columns()

    def noise_of(self, fit: Fit) -> Noise:
        """The noise of a fit to the same recording, sampled otherwise, whose readings had another variance."""
        theirs = float(np.mean([self._noises(s.trace)[0] ** 2 for s in fit.shots]))
        ratio, q = theirs / self.reading_variance, fit.noise
        return self.bounds.within(
            replace(
                q, white=ratio * q.white, slow=ratio * q.slow, walk=ratio * q.walk, ahead=ratio * q.ahead,
                smooth=ratio * q.smooth,
            )
        )  # fmt: skip

    def fit(
        self, structure: Structure, start: Mapping[Name, float], noise: Noise | None = None, iterations: int = 25,
        carry: Sequence[Shots] | None = None, fixed: Sequence[Name] = (), thorough: bool = True,
        against: float | None = None, least: float = np.inf,
    ) -> Fit:  # fmt: skip
        """Fit all parameters of a structure together with the noise.

        Parameters
        ----------
        start
            Values to begin from; what is missing begins at zero.
        noise
            To begin from; None looks for the best on a grid.
        carry
            Runs of an earlier fit, whose biases (and start states, where they are fitted) to begin from.
        fixed
            Parameters that stay at their start value.
        thorough
            Look at quite other noises, too, before it ends.
        against
            Cost of the model that it is compared with: a small share of the difference is as near as it has to come.
        least
            Cost that it must be below after a few steps to be followed to its end.
        """
        # A rough disturbance and a smooth one are two valleys, and parameters far off may stay in the wrong one: where
        # nobody knows the noise, a thorough fit tries both.
        valleys = ((False,), (True,)) if noise is None and thorough else ((False, True),)

        def down(smooth: Sequence[bool]) -> Fit | None:
            with np.errstate(all="ignore"):
                descent = Descent(self, structure, start, noise, carry, fixed, smooth)
                left = descent.minimise(iterations, thorough, against, least)
                # Where a run begins stuck is another place with another friction.
                while left > 0 and descent.sticks and descent.cost < least:
                    values = dict(zip(descent.names, descent.x.tolist(), strict=True))
                    again = Descent(self, structure, values, descent.noise, descent.shots, fixed)
                    if abs(again.cost - descent.cost) < COST_TOLERANCE:
                        break
                    left = again.minimise(left, thorough, against, least)
                    if not again.cost < descent.cost - COST_TOLERANCE:
                        break
                    descent = again
                ran_away = not np.isfinite(descent.cost) and len(valleys) > 1
                return None if ran_away else replace(descent.found(), arrived=against is None and left > 0)

        ends = self.workers.side_by_side([partial(down, smooth) for smooth in valleys])
        fits = [fit for fit in ends if fit is not None]
        if not fits:
            return self.fit(structure, start, noise, iterations, carry, fixed, False, against, least)
        return min(fits, key=lambda fit: fit.cost)

    @RUNAWAY
    def look(
        self, s: Shots, structure: Structure, names: Sequence[Name], x: Array, noise: Noise, kept: Gains | None = None
    ) -> Look:
        """One run predicted at a parameter vector, with its own gains or with ``kept`` ones."""
        equations = equations_of(structure, names, x, s.number, s.added)
        trace = s.trace
        spans = [(a, b - 1) for a, b in s.edges]
        sensing = self._sensing(trace, equations)
        gains = kept or self._gains.of(
            s.trace,
            self._linear_part(equations),
            noise,
            sensing,
            spans,
            self._begun_of(structure, sensing.lag, noise),
            s.in_motion,
        )
        measured, low_pass = self._readings(trace), trace.low_pass
        smoothing = None if low_pass is None else s.grid.smoothing(equations, low_pass)
        predicted, state = predict_ahead(
            equations, s.grid.shaft_torque(equations), s.grid.step_s, round(trace.step_s / s.grid.step_s), spans,
            s.starts, measured, trace.keep, gains, sensing.rate, s.bias, trace.since_start_s, trace, s.reads, low_pass,
            smoothing,
        )  # fmt: skip
        return Look(measured - predicted, gains.variance, state, gains, self.floor_of(sensing.lag, noise))

    def floor_at(self, s: Shots, structure: Structure, names: Sequence[Name], x: Array, noise: Noise) -> float:
        """Least variance of one reading at a parameter vector, which no reading is needed for."""
        equations = equations_of(structure, names, x, s.number, s.added)
        return self.floor_of(self._sensing(s.trace, equations).lag, noise)

    def gains_at(self, s: Shots, structure: Structure, names: Sequence[Name], x: Array, noise: Noise) -> Gains:
        """One run's gains at a parameter vector, which no reading is needed for."""
        equations = equations_of(structure, names, x, s.number, s.added)
        spans = [(a, b - 1) for a, b in s.edges]
        linear, sensing = self._linear_part(equations), self._sensing(s.trace, equations)
        begun = self._begun_of(structure, sensing.lag, noise)
        return self._gains.of(s.trace, linear, noise, sensing, spans, begun, s.in_motion)

    def _begun_of(self, structure: Structure, lag: tuple[float, float], noise: Noise) -> StartVariance:
        """How well the start of a stretch is known.

        In rad and rad/s that is so whatever the noise is. Where the gyro's comes from ahead of its low-pass a reading's
        own, in whose variance all is counted, is a small part of it.
        A gyro's angle counts from where a run begins. A spring has an origin of its own, and a platform that swings
        or is held by friction may begin anywhere about it. Without one, a run that begins at rest begins at zero; were
        that left open, the first readings would throw the angle across the waves of what depends on it.
        """
        at_zero = self._begins_at_zero and "stiffness" not in structure.terms
        begun = self._begun._replace(angle=0.0) if at_zero else self._begun
        own = 1.0 if self.both else self.bounds.shown_above(noise, lag)
        return begun if own == 1.0 else StartVariance(*(own * x for x in begun))

    def _linear_part(self, equations: Equations) -> LinearPart:
        """The platform as a Kalman filter takes it, with the effects' mean slopes along the motion.

        The spring of a pendulum is gravity, and dry friction damps. Gains of a platform without either would follow
        another motion (statistical linearisation: Gelb and Vander Velde 1968).
        """
        if not equations.body:
            return LinearPart(*equations.jck.tolist())
        key = (equations.jck.tobytes(), equations.p.tobytes(), equations.body)
        with self._slopes_lock:
            found = self._slopes.get(key)
            if found is None:
                inertia, damping, stiffness = equations.jck.tolist()
                damps, pulls = mean_slopes(equations, self.traces)
                # Gains of a linear part that runs away are none; an effect that drives it does so for a while only.
                found = linear_part(
                    equations, [inertia, damping + max(damps, 0.0), max(stiffness + pulls, min(stiffness, 0.0))]
                )  # fmt: skip
                if len(self._slopes) > SLOPE_CACHE_SIZE:
                    self._slopes.clear()
                self._slopes[key] = found
        return found

    def _readings(self, trace: Trace) -> Array:
        """What was read at every sample, (n, m), the gyro's reading before the encoder's."""
        if not self.both:
            return trace.measured[:, None]
        first = trace.channel == "rate"
        other = np.asarray(trace.beside)
        return np.column_stack([trace.measured, other] if first else [other, trace.measured])

    def _noises(self, trace: Trace) -> tuple[float, ...]:
        """Standard deviation of each of these readings."""
        if not self.both:
            return (trace.noise,)
        return (trace.noise, trace.beside_noise) if trace.channel == "rate" else (trace.beside_noise, trace.noise)

    def _sensing(self, trace: Trace, equations: Equations) -> Sensing:
        """How it was read, the sensor's low-passes taken together."""
        rate = self.both or trace.channel == "rate"
        first, second = 0.0, 0.0
        for name, values in zip(equations.sensor.names, equations.sensor.values, strict=True):
            lag = effects.get(name).lag
            if rate and lag is not None:
                a, b = lag(values)
                first, second = first + a, second + b + first * a
        if not self.both:
            return Sensing(rate, 0.0 if rate else 1.0, (first, second))
        gyro, encoder = self._noises(trace)
        return Sensing(True, (encoder / gyro) ** 2, (first, second), (MOST_BIAS_RAD_S / gyro) ** 2)

    def _start_variance(self) -> StartVariance:
        """Of angle and rate, read off the smoothed motion; of acceleration and jerk only their size is known."""
        smoothed = float(np.mean([t.fine[4] ** 2 for t in self.traces]))
        rate = 4.0 * smoothed + (START_RATE * self.rate_rad_s) ** 2
        known = self.both or all(t.channel == "angle" for t in self.traces)
        noise = float(np.sqrt(np.mean([self._noises(t)[-1] ** 2 for t in self.traces]))) if known else 0.0
        angle = 4.0 * noise**2 + ((START_ANGLE if known else UNKNOWN_ANGLE) * self.angle_rad) ** 2
        jerk = _rms([np.gradient(np.gradient(t.fine[1], t.fine[2]), t.fine[2]) for t in self.traces])
        sizes = self.acceleration**2, jerk**2, self.rate_rad_s**2
        return StartVariance(*(x / self.reading_variance for x in (angle, rate, *sizes)))


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean([float(np.mean(x * x)) for x in parts]))) + 1e-300
