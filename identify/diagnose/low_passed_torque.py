"""Torque, motion and the torque of effects behind one low-pass, at the samples where the platform moves.

A run without torque is one whose inertia is known to be one: the deceleration is what damping, stiffness and effects,
all per unit of inertia, have to explain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from identify.diagnose.torque_residual import at_samples, lags_of, motion
from identify.model.parameters import Name
from identify.model.structure import UNIT, Shapes, Structure
from identify.runs.holdout import Split
from identify.signals.low_pass import low_pass, settled
from identify.signals.trace import MOST_BIAS_RAD_S, SHORTEST_STRETCH, UPSAMPLING, Trace
from rig import effects
from rig.arrays import Array
from rig.effects.base import Effect, Place, Scale
from rig.platform import TERMS

SAMPLES_A_CUTOFF_PERIOD = 4.0  # of the cut-off: what the low-pass passed needs no more
FOLDS, FOLD_BLOCKS = 3, 9  # a third of the runs, or of the blocks of each run, is held out in turn
STILL_SIGMAS, STILL_PERIODS = 5.0, 0.5  # standard deviations of the smoothed rate, for so many periods of the cut-off
MOST_BIAS_SHARE = 0.25  # of a run's rate: what stays and is more is a steady motion
STANDS_OUT = 3.0  # times as often as if all small rates that stay were read alike
NOISE_DRAWS = 3  # of the sensor's noise
AROUND_REVERSAL, MAX_REVERSAL_SHARE = 0.6, 0.35  # periods of the cut-off left out either side, up to a share of samples

_QUANTITIES = {"angle": 0, "rate": 1, "torque": 3}  # of a trace's fine motion


class LowPassedTorque:
    """The columns of structures in torque over a set of runs, at the samples where the platform moves.

    Parameters
    ----------
    traces, split
        The runs, and which of their samples fit and which judge.
    cutoff_hz
        Of the low-pass.
    scale
        How large the motion is: where shapes are looked for.
    """

    def __init__(self, traces: Sequence[Trace], split: Split, cutoff_hz: float, scale: Scale) -> None:
        self.traces, self.split, self.cutoff_hz, self.scale = list(traces), split, cutoff_hz, scale
        self.torque_free = all(t.torque is None for t in traces)
        self.by_gyro = all(t.channel == "rate" for t in traces)  # whose low-pass delays the motion that is seen here
        self.runs = 1 + max(t.number for t in traces)
        step = max(1, int(1.0 / (SAMPLES_A_CUTOFF_PERIOD * cutoff_hz * traces[0].step_s)))
        self._rows = [self._rows_of(t, step, t.keep & ~self._standing(t)) for t in traces]
        if sum(map(len, self._rows)) < SHORTEST_STRETCH:  # no motion stands out of the noise: rest cannot be told
            self._rows = [self._rows_of(t, step, t.keep) for t in traces]
        declared = any(t.run.use == "holdout" for t in traces)
        fit = [np.asarray(m)[r] for m, r in zip(split.fit, self._rows, strict=True)]
        judge = [np.asarray(m)[r] for m, r in zip(split.judge, self._rows, strict=True)]
        used = np.concatenate([f | j for f, j in zip(fit, judge, strict=True)])
        self._used = used
        self._fitted = used & ~np.concatenate(judge) if declared else used  # what was declared as held out fits nothing
        if declared:
            self._by_block = self._by_run = [np.concatenate(judge)]
        else:
            blocks = np.concatenate([self._block_of(i) + i for i in range(len(traces))])
            runs = np.concatenate([np.full(len(r), i) for i, r in enumerate(self._rows)])
            self._by_block = [used & (blocks % FOLDS == k) for k in range(FOLDS)]
            several = len(traces) >= FOLDS
            self._by_run = [used & (runs % FOLDS == k) for k in range(FOLDS)] if several else self._by_block
        self.judges_by_other_runs = declared or len(traces) >= FOLDS  # else by other parts of the same runs
        self._judged = np.any(self._by_block, axis=0)
        self._cache: dict[Any, Array] = {}
        self.torque_nm = float(np.sqrt(np.mean(np.concatenate([self._target(i, ()) for i in range(len(traces))]) ** 2)))

    def _block_of(self, i: int) -> Any:
        """Which block of its run every sample belongs to."""
        return np.minimum(self._rows[i] * FOLD_BLOCKS // max(len(self.traces[i].measured), 1), FOLD_BLOCKS - 1)

    def _rows_of(self, t: Trace, step: int, counts: Any) -> Any:
        """Every ``step``-th sample of a run that ``counts``, (m,), and at which the low-pass has settled."""
        return np.arange(0, len(t.measured), step)[(settled(t.keep, t.step_s, self.cutoff_hz) & counts)[::step]]

    def _standing(self, t: Trace) -> Any:
        """Samples at which the platform stands or turns back, (n,).

        Static friction holds it there with any torque that it takes; and when exactly friction changes its sign, behind
        the low-pass, decides over more torque there than all that one wants to see. Where it turns back so often that
        little else is left, those moments stay.
        """
        rate, left = t.fine[1][::UPSAMPLING] - _read_at_rest(t, self.cutoff_hz), t.fine[4]
        slow = np.abs(rate) < STILL_SIGMAS * left
        shortest = _shortest_rest(t, self.cutoff_hz)
        out = np.zeros(len(slow), dtype=bool)
        edges = np.diff(np.concatenate([[0], slow.astype(np.int8), [0]]))
        for a, b in zip(np.nonzero(edges == 1)[0], np.nonzero(edges == -1)[0], strict=True):
            if b - a >= shortest:
                out[max(0, a - shortest) : b + shortest] = True
        reach = int(np.ceil(AROUND_REVERSAL / (self.cutoff_hz * t.step_s)))
        turned = np.nonzero(np.diff(np.sign(rate)) != 0)[0]
        near = np.zeros(len(slow), dtype=bool)
        for k in turned:
            near[max(0, k - reach + 1) : k + reach + 1] = True
        return out | near if np.mean(near & t.keep) < MAX_REVERSAL_SHARE * np.mean(t.keep) else out

    def _passed(self, i: int, values: Array) -> Array:
        return low_pass(values, self.cutoff_hz, self.traces[i].step_s)[self._rows[i]]

    def _kept(self, key: Any, make: Any) -> Array:
        found = self._cache.get(key)  # another thread may clear it
        if found is None:
            if len(self._cache) > 3000:
                self._cache.clear()
            found = self._cache[key] = make()
        return found

    @cached_property
    def _motion(self) -> list[tuple[Array, Array, Array]]:
        return [tuple(x[r] for x in motion(t, self.cutoff_hz)) for t, r in zip(self.traces, self._rows, strict=True)]

    def _target(self, i: int, drive: tuple[tuple[str, tuple[float, ...]], ...]) -> Array:
        def make() -> Array:
            t = self.traces[i]
            pieces = t.torque_pieces(drive)
            if pieces is None:
                return -self._motion[i][2]
            return self._passed(i, at_samples(pieces[0], len(t.measured), pieces[1]))

        return self._kept(("torque", i, drive), make)

    def _of_effect(self, i: int, effect: Effect, shape: tuple[float, ...], unit: int) -> Array:
        t = self.traces[i]
        return self._kept(
            (i, effect.name, shape, unit),
            lambda: self._passed(i, at_samples(t.effect_pieces(effect, shape, unit), len(t.measured))),
        )

    def _columns(self, i: int, structure: Structure, shapes: Shapes) -> tuple[Array, list[Name], Array]:
        """Columns and their names, and the target, of one run; what is free in the run stands behind the names."""
        t = self.traces[i]
        angle, rate, acceleration = self._motion[i]
        terms = {"inertia": acceleration, "damping": rate, "stiffness": angle}
        known = ("inertia",) if self.torque_free else ()
        out: dict[Name, Array] = {(k,): terms[k].copy() for k in TERMS if k in structure.terms and k not in known}
        passes = [n for n in structure.effects if effects.get(n).place is Place.DRIVE]
        passes += lags_of(structure.effects) if self.by_gyro else []
        drive = tuple((n, tuple(shapes[n])) for n in passes)
        for name in structure.effects:
            effect = effects.get(name)
            if effect.place in (Place.DRIVE, Place.SENSOR):
                continue
            shape = tuple(shapes.get(name, ()))
            for k, p in enumerate(effect.parameters):
                if p.linear:
                    key = (name, p.name, str(t.number)) if p.per_run else (name, p.name)
                    out[key] = self._of_effect(i, effect, shape, k)
            for term in effect.leans_on:
                if (term,) in out:
                    out[(term,)] = out[(term,)] + self._of_effect(i, effect, shape, UNIT[term])
        target = self._target(i, drive)
        if t.run.added_inertia_kg_m2:
            target = target - t.run.added_inertia_kg_m2 * acceleration
        own = []
        if t.biased:
            for a, b in t.stretches:
                here = (self._rows[i] >= a) & (self._rows[i] <= b)
                own += [here.astype(float), here * (self._rows[i] - a) * t.step_s]
        return np.column_stack([*out.values(), *own]) if out or own else np.zeros((len(target), 0)), list(out), target

    def noise_floor_nm(self, values: Mapping[Name, float]) -> float:
        """What the sensor's noise alone leaves of the torque, root mean square, from simulated noise."""
        return float(np.sqrt(np.mean(self._of_noise(values, 1) ** 2)))

    def made_by_noise_nm(self, values: Mapping[Name, float], columns: Array, ridge: Array) -> float:
        """What columns, (n, k), explain of the sensor's noise alone, root mean square, from simulated noise.

        ``ridge``, (k,), is what their normal equations have besides.
        """
        solving = np.linalg.pinv(columns.T @ columns + np.diag(ridge), hermitian=True) @ columns.T
        squares = []
        for seed in range(1, 1 + NOISE_DRAWS):
            noise = self._kept(("noise", seed, tuple(values.items())), partial(self._of_noise, values, seed))
            squares.append(np.mean((columns @ (solving @ noise)) ** 2))
        return float(np.sqrt(np.mean(squares)))

    def _of_noise(self, values: Mapping[Name, float], seed: int) -> Array:
        """What a draw of the sensor's noise leaves of the torque at the samples of all runs, (n,)."""
        inertia = 1.0 if self.torque_free else values.get(("inertia",), 0.0)
        out: list[Array] = []
        motions = self.motion_of_noise(seed)
        for trace, rows, (angle, rate, acceleration) in zip(self.traces, self._rows, motions, strict=True):
            if len(rows) == 0:
                continue
            left = (inertia + trace.run.added_inertia_kg_m2) * acceleration + values.get(("damping",), 0.0) * rate
            left = left + values.get(("stiffness",), 0.0) * (angle - np.mean(angle))
            if trace.biased:
                line = np.column_stack([np.ones(len(rows)), rows])
                left = left - line @ np.linalg.lstsq(line, left, rcond=None)[0]
            out.append(left)
        return np.concatenate(out)

    def motion_of_noise(self, seed: int) -> list[tuple[Array, Array, Array]]:
        """Angle, rate and acceleration that a draw of the sensor's noise adds to every run, behind the low-pass."""
        return self._kept(("motion of noise", seed), partial(self._draw, seed))  # type: ignore[return-value]

    def _draw(self, seed: int) -> list[tuple[Array, Array, Array]]:
        rng = np.random.default_rng(seed)
        out = []
        for trace, rows in zip(self.traces, self._rows, strict=True):
            noise = trace.noise * rng.standard_normal(len(trace.measured))
            read = trace.beside
            of_angle = None if read is None else trace.beside_noise * rng.standard_normal(len(read))
            only = replace(trace, measured=noise, beside=of_angle, drift_rad=None, motion=None, _series={})
            angle, rate, acceleration = motion(only, self.cutoff_hz)
            out.append((angle[rows], rate[rows], acceleration[rows]))
        return out

    def ahead(self, quantity: str, without: Sequence[Array] = ()) -> list[Array]:
        """Angle, rate or torque of every run as it is, ahead of the low-pass, (n,); without a residual behind it."""
        k = _QUANTITIES[quantity]
        values = [np.asarray(t.fine[k])[::UPSAMPLING] for t in self.traces]
        if not without:
            return values
        parts = zip(values, self._rows, without, strict=True)
        return [x - np.interp(np.arange(len(x)), rows, r) if len(rows) else x for x, rows, r in parts]

    def at_rows(self, series: Sequence[Array]) -> Array:
        """What every run has ahead of the low-pass at the samples behind it, (n,)."""
        return np.concatenate([x[rows] for x, rows in zip(series, self._rows, strict=True)])

    def along(self, series: Sequence[Array], of: Callable[[Array], Array]) -> Array:
        """Functions of what every run has ahead of the low-pass, (m, k) for (m,) values, behind it as a torque is."""
        out = [np.stack([self._passed(i, c) for c in of(x).T], axis=1) for i, x in enumerate(series)]
        return np.concatenate(out)

    def with_wave(self, quantity: str, frequency_hz: float) -> Array:
        """A quantity times cosine and sine of a wave over each run's time, behind the low-pass, (n, 2)."""
        out = []
        for i, (x, t) in enumerate(zip(self.ahead(quantity), self.traces, strict=True)):
            phase = 2.0 * np.pi * frequency_hz * t.step_s * np.arange(len(x))
            out.append(np.stack([self._passed(i, x * f(phase)) for f in (np.cos, np.sin)], axis=1))
        return np.concatenate(out)

    def series(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Angle, rate, acceleration, torque, time and number of the run at every sample behind the low-pass."""
        motions = [np.concatenate([m[k] for m in self._motion]) for k in range(3)]
        torque = np.concatenate([self._target(i, ()) for i in range(len(self.traces))])
        time = np.concatenate([r * t.step_s for r, t in zip(self._rows, self.traces, strict=True)])
        return motions[0], motions[1], motions[2], torque, time, self.run_of_each

    @property
    def run_of_each(self) -> Any:
        """Number of the run at every sample behind the low-pass, (n,)."""
        return np.concatenate([np.full(len(r), i) for i, r in enumerate(self._rows)])


def _read_at_rest(t: Trace, cutoff_hz: float) -> float:
    """What a gyro reads while the platform stands, rad/s: what it reads most often of what stays, if a bias.

    Zero where nothing stands out: a slow motion reads no small rate more often than another one.
    """
    rate, width = t.fine[1][::UPSAMPLING], 2.0 * STILL_SIGMAS * t.fine[4]
    most = min(MOST_BIAS_RAD_S, MOST_BIAS_SHARE * float(np.sqrt(np.mean(rate**2))))
    if not t.biased or width > most:
        return 0.0
    window = _shortest_rest(t, cutoff_hz)
    stays = maximum_filter1d(rate, window) - minimum_filter1d(rate, window) < width
    slow = np.sort(rate[stays & (np.abs(rate) < most)])
    if len(slow) < window:
        return 0.0
    ends = np.searchsorted(slow, slow + width)
    first = int(np.argmax(ends - np.arange(len(slow))))
    alike = slow[first : ends[first]]
    return float(np.median(alike)) if len(alike) > STANDS_OUT * len(slow) * width / (2.0 * most) else 0.0


def _shortest_rest(t: Trace, cutoff_hz: float) -> int:
    """Samples that the platform has to stand for: half a period of the low-pass."""
    return max(3, int(STILL_PERIODS / (cutoff_hz * t.step_s)))
