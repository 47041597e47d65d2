"""How far a gyro's angle has drifted from where the platform is, by the spring that holds it.

The angle is the integral of the rate, and the integral of the gyro's bias goes with it: a tenth of a degree a second
over a minute is six degrees. What turned while readings were lost is missing besides. A linear model does not mind; a
spring that stiffens is looked for at angles at which the platform never was. But the spring itself tells: what inertia,
damping, friction and spring leave of the torque is the spring's pull over the drift, and that is slow. It is taken for
a polynomial in time over every stretch, with a step where readings were lost, fitted together with them by least
squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from identify.runs.reduced import thinned
from identify.signals.low_pass import GAP_PERIODS, low_pass, settled
from identify.signals.trace import MOST_WALK, UPSAMPLING, Trace
from rig.arrays import Array

# All set by hand, on one recording with three gaps and on simulated ones; ``MOST_WALK`` is the likelihood's own bound.
DRIFT_SAMPLES = 40_000  # of all runs together, that the drift is looked for in
DRIFT_DEGREES = (1, 2, 3, 5, 8, 12, 18)  # of the polynomial: a bias that stays makes a line, its walk bends that
PERIODS_A_DEGREE = 8.0  # of the platform's own swing, that a stretch lasts at least for each degree
SPRING_POWERS = 3  # of the angle, by which a spring is followed
DRIFT_ROUNDS = (1, 1, *4 * (SPRING_POWERS,))  # the powers, of the angle that the round before has found
KNOWN_SIGMAS = 10.0  # standard errors of the spring's stiffness: one that is known worse holds nothing
DRIFT_BLOCKS = 20  # of each stretch; every other one is held out where degrees are compared
LEAST_LOST, MOST_GAPS = 4.0, 20  # samples that a gap lasts at least, and gaps of a run at which the angle may step
SPANNED_RCOND = 1e-9  # of the largest singular value: what a polynomial and its steps span
WORTH_IT = 0.9  # of the power on held-out samples, that a higher degree leaves at most: a slow torque is no drift
ROWS_A_PERIOD = 4.0  # of the low-pass
SLOW_SHARE = 0.02  # of the largest rate: below, static friction may hold the platform


def without_drift(traces: Sequence[Trace], cutoff_hz: float) -> list[Trace]:
    """The same runs, with the drift of their angles taken out where a spring tells it.

    Parameters
    ----------
    traces
        Whole runs.
    cutoff_hz
        Of the low-pass that torque and motion pass.
    """
    if not all(t.biased and t.torque is not None for t in traces):
        return list(traces)
    few, _ = thinned(traces, [t.keep for t in traces], DRIFT_SAMPLES)
    runs = [_Run(t, min(cutoff_hz, t.cutoff_hz)) for t in few]
    own_hz = _own_hz(runs) if all(r.stretches for r in runs) else None
    if own_hz is None:
        return list(traces)
    least = np.inf
    best: list[Array] = []
    most = [[int((b - a) * r.step_s * own_hz / PERIODS_A_DEGREE) for a, b in r.spans] for r in runs]
    capped = {tuple(tuple(min(degree, n) for n in run) for run in most): None for degree in DRIFT_DEGREES}
    for degrees in capped:
        for r, own in zip(runs, degrees, strict=True):
            r.begin(own)
        held = _follow(runs)
        if held < WORTH_IT * least and all(map(_may_be_bias, runs)):
            least, best = held, [_over(t, r) for t, r in zip(traces, runs, strict=True)]
    if not best:
        return list(traces)
    return [replace(t, drift_rad=d, motion=None, _series={}) for t, d in zip(traces, best, strict=True)]


def _may_be_bias(run: _Run) -> bool:
    """Whether what bends a run's drift may be the walk of a gyro's bias; if not, it is a torque."""
    walks = 0.0
    for (first, last), drift, gaps in zip(run.spans, run.drifts, run.gaps, strict=True):
        bends = legendre.legder(drift[: len(drift) - len(gaps)])
        bias = legendre.legval(np.linspace(-1.0, 1.0, DRIFT_BLOCKS)[1:-1], bends) * 2.0 / (last - first)
        walks = max(walks, float(np.ptp(bias)) / run.step_s)
    return walks <= MOST_WALK * float(np.sqrt(np.mean(run.rate**2)))


class _Run:
    """A run, torque and motion seen behind a low-pass at the samples that count, and the drift of its angle.

    Attributes
    ----------
    gaps
        Of every stretch: where readings were lost for long enough to miss a turn, in samples.
    drifts
        Of every stretch: coefficients of its Legendre polynomials, and of its steps at these gaps, in rad.
    """

    def __init__(self, trace: Trace, cutoff_hz: float) -> None:
        assert trace.torque is not None
        self.step_s, self.cutoff_hz = trace.step_s, cutoff_hz
        self.angle, self.rate, _, torque = (np.asarray(x)[::UPSAMPLING] for x in trace.fine[:4])
        acceleration = self._passed(np.gradient(self.rate, trace.step_s))
        slow = SLOW_SHARE * float(np.max(np.abs(self.rate))) + 1e-300
        counts = settled(trace.keep, trace.step_s, cutoff_hz) & (np.abs(self.rate) > slow)
        every = max(1, int(1.0 / (ROWS_A_PERIOD * cutoff_hz * trace.step_s)))
        lost = _gaps(trace, max(GAP_PERIODS / cutoff_hz, LEAST_LOST * trace.step_s))
        self.stretches, self.spans, self.gaps, rows = [], [], [], []
        for first, last in trace.stretches:
            here = np.arange(first, last + 1, every)
            here = here[counts[here]]
            if len(here) >= 4 * DRIFT_BLOCKS:
                self.stretches.append((first, last))
                self.spans.append((int(here[0]), int(here[-1])))
                between = np.searchsorted(lost, here)  # one step where nothing counts between two gaps
                self.gaps.append(lost[between[np.flatnonzero(np.diff(between))]])
                rows.append(here)
        self.sizes = [len(r) for r in rows]
        self.rows = np.concatenate(rows) if rows else np.zeros(0, dtype=int)
        self.torque = (self._passed(torque) - trace.run.added_inertia_kg_m2 * acceleration)[self.rows]
        direction = self._passed(np.tanh(self.rate / slow))
        self.of_motion = np.column_stack([acceleration, self._passed(self.rate), direction])[self.rows]
        self.begin([1] * len(rows))

    def begin(self, degrees: Sequence[int]) -> None:
        """Look for drifts of other degrees, from none at all."""
        self.drifts = [np.zeros(d + 1 + len(gaps)) for d, gaps in zip(degrees, self.gaps, strict=True)]
        self.polynomials = [
            np.column_stack([legendre.legvander(through(span, rows), degree), steps_at(gaps, rows)])
            for span, gaps, rows, degree in zip(self.spans, self.gaps, self.by_stretch(self.rows), degrees, strict=True)
        ]

    def by_stretch(self, values: Any) -> list[Any]:
        """What stands for the samples that count, stretch by stretch."""
        return np.split(values, np.cumsum(self.sizes)[:-1]) if self.sizes else []

    def columns(self, powers: int) -> tuple[Array, Array]:
        """Acceleration, rate, direction, and a spring's powers of the angle, (n, 3 + powers); and the angle, (n,)."""
        angle = self.angle.copy()
        for (first, last), span, gaps, drift in zip(self.stretches, self.spans, self.gaps, self.drifts, strict=True):
            at = np.arange(first, last + 1)
            angle[at] -= drift_at(span, gaps, drift, at)
        passed = [self._passed(angle**k)[self.rows] for k in range(1, powers + 1)]
        return np.column_stack([self.of_motion, *passed]), angle[self.rows]

    def _passed(self, values: Array) -> Array:
        return low_pass(values, self.cutoff_hz, self.step_s)


def through(span: tuple[int, int], at: Any) -> Array:
    """Where samples lie: -1 at the first that counts in a stretch, 1 at the last."""
    first, last = span
    return np.asarray(2.0 * (at - first) / (last - first) - 1.0)


def steps_at(gaps: Array, at: Any) -> Array:
    """Which samples lie behind each gap, (n, gaps)."""
    return np.asarray(np.asarray(at)[:, None] > gaps, dtype=float)


def drift_at(span: tuple[int, int], gaps: Array, drift: Array, at: Any) -> Array:
    """A stretch's drift; no polynomial is extrapolated: ahead of what counts and behind it goes on as on average."""
    x = through(span, at)
    inside = np.clip(x, -1.0, 1.0)
    bent, steps = np.split(drift, [len(drift) - len(gaps)])
    slope = bent[1] if len(bent) > 1 else 0.0
    return np.asarray(legendre.legval(inside, bent) + (x - inside) * slope + steps_at(gaps, at) @ steps)


def _gaps(trace: Trace, longest_s: float) -> Array:
    """The middle of every gap between readings that lasts longer, in samples; of many, the longest."""
    seen = np.flatnonzero(trace.keep)
    missed = np.diff(seen)
    long = np.flatnonzero(missed * trace.step_s > longest_s)
    long = np.sort(long[np.argsort(-missed[long], kind="stable")][:MOST_GAPS])
    return np.asarray(0.5 * (seen[long] + seen[long + 1]))


def _over(trace: Trace, run: _Run) -> Array:
    """The drift at every sample of a run, (n,): none where it begins, straight on over what does not count."""
    times = run.step_s / trace.step_s
    at = np.arange(len(trace.measured))
    known = np.zeros(len(at), dtype=bool)
    out = np.zeros(len(at))
    for (first, last), span, gaps, drift in zip(run.stretches, run.spans, run.gaps, run.drifts, strict=True):
        here = at[int(first * times) : min(int(last * times) + 1, len(at))]
        out[here] = drift_at(span, gaps, drift, here / times)
        known[here] = True
    out = np.interp(at, at[known], out[known])
    return np.asarray(out - out[0])


def _own_hz(runs: Sequence[_Run]) -> float | None:
    """The platform's own frequency by a linear model, the low-pass's at most; None where no spring is seen."""
    a, y = _projected(runs, [r.columns(1)[0] for r in runs])
    x, error = _least_squares(np.concatenate(a), np.concatenate(y))
    if x[3] < KNOWN_SIGMAS * error[3]:
        return None
    cutoff_hz = runs[0].cutoff_hz
    return min(float(np.sqrt(x[3] / x[0]) / (2.0 * np.pi)), cutoff_hz) if x[0] > 0.0 else cutoff_hz


def _follow(runs: Sequence[_Run]) -> float:
    """Find the drift of every run, and what is left on samples held out; infinite where no spring holds."""
    for powers in DRIFT_ROUNDS:
        columns, angles = zip(*(r.columns(powers) for r in runs), strict=True)
        a, y = _projected(runs, columns)
        x, error = _least_squares(np.concatenate(a), np.concatenate(y))
        angle = np.concatenate(angles)
        pull = float(np.mean(sum(k * x[2 + k] * angle ** (k - 1) for k in range(1, powers + 1))))
        if not pull > KNOWN_SIGMAS * error[3]:
            return np.inf
        for r, own in zip(runs, columns, strict=True):
            left = r.by_stretch(r.torque - own @ x)
            for i, (p, e) in enumerate(zip(r.polynomials, left, strict=True)):
                r.drifts[i] = r.drifts[i] - np.linalg.lstsq(p, e, rcond=None)[0] / pull
    return _held_out(runs)


def _held_out(runs: Sequence[_Run]) -> float:
    """Sum of squares of the blocks where they are left out of the fit."""
    columns = [r.columns(SPRING_POWERS)[0] for r in runs]
    out = 0.0
    for k in (0, 1):
        fold = []
        for r in runs:
            places = zip(r.spans, r.by_stretch(r.rows), strict=True)
            at = [((1.0 + through(*place)) / 2.0 * DRIFT_BLOCKS).astype(int) for place in places]
            # At the ends of a stretch no polynomial is extrapolated.
            fold.append([(b % 2 == k) & (b > 0) & (b < DRIFT_BLOCKS - 1) for b in at])
        a, y = _projected(runs, columns, fold)
        x, _ = _least_squares(np.concatenate(a), np.concatenate(y))
        for r, own, folds in zip(runs, columns, fold, strict=True):
            for p, e, f, gaps in zip(r.polynomials, r.by_stretch(r.torque - own @ x), folds, r.gaps, strict=True):
                left = e - p @ np.linalg.lstsq(p[~f], e[~f], rcond=None)[0]
                piece = np.sum(p[:, p.shape[1] - len(gaps) :], axis=1)
                out += float(np.sum(left[f & np.isin(piece, piece[~f])] ** 2))  # a step that nothing fits tells nothing
    return out


def _projected(
    runs: Sequence[_Run], columns: Sequence[Array], without: Sequence[Sequence[Any]] | None = None
) -> tuple[list[Array], list[Array]]:
    """Columns and torque of every stretch, its polynomial taken out of both; ``without`` some of its samples."""
    a, y = [], []
    for i, (r, own) in enumerate(zip(runs, columns, strict=True)):
        for k, p in enumerate(r.polynomials):
            use = np.ones(len(p), dtype=bool) if without is None else ~without[i][k]
            q = _spanned(p[use])
            mine, torque = r.by_stretch(own)[k][use], r.by_stretch(r.torque)[k][use]
            a.append(mine - q @ (q.T @ mine))
            y.append(torque - q @ (q.T @ torque))
    return a, y


def _spanned(p: Array) -> Array:
    """An orthonormal basis: where nothing counts between two gaps, their steps are one direction."""
    q, upper = np.linalg.qr(p)
    diagonal = np.abs(np.diag(upper))
    if np.min(diagonal) > SPANNED_RCOND * np.max(diagonal):
        return np.asarray(q)
    all_of_it, size, _ = np.linalg.svd(p, full_matrices=False)
    return np.asarray(all_of_it[:, size > SPANNED_RCOND * size[0]])


def _least_squares(a: Array, y: Array) -> tuple[Array, Array]:
    """Solution and its standard errors."""
    size = np.sqrt(np.mean(a * a, axis=0)) + 1e-300
    x, *_ = np.linalg.lstsq(a / size, y, rcond=None)
    left = y - (a / size) @ x
    covariance = np.linalg.pinv((a / size).T @ (a / size)) * float(np.mean(left**2))
    return x / size, np.sqrt(np.diag(covariance)) / size
