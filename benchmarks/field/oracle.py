"""What a record can tell to somebody who knows the structure: energies, rivals and the Cramer-Rao bound.

A Kalman filter that knows rig, sensors and disturbance turns a torque that the model lacks into normalised
innovations: what it leaves there is what the record shows of it, in units of chi-square, whatever made the
recorded torque (a loop or not). Nonlinear torques are taken along the true motion. Start state, gyro bias and
flicker are states of the filter, so they take what they can; steps are as long as they truly were.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from benchmarks.field import noise
from benchmarks.field.plant import CODES, PARAMETERS, STATES, jit
from benchmarks.field.recording import Levels, Measured, Motion
from benchmarks.field.rigs import Rig
from benchmarks.field.simulation import along

TH, W, FAST, SLOW, BIAS = range(5)
GYRO_STATES = BIAS + 1 + len(noise.FLICKER_TIMES_S)
STEP = 1e-3  # relative, of the differences


@jit
def _filtered(a, b, q, which, p0, c, r, readings, arrived, doubt, torque, slope):  # type: ignore[no-untyped-def]
    """Normalised innovations (rows of all readings, columns) that columns of torque in N m leave.

    ``readings`` (n, m, columns) are subtracted at the sensors; ``torque`` and ``slope`` (n - 1, columns), mean and
    change over a step, drive the shaft; ``doubt`` (n - 1) is the variance of the mean. ``which`` says of each step
    which of the matrices belongs to its length.
    """
    n, m, columns = readings.shape
    s = a.shape[1]
    out = np.zeros((n * m, columns))
    x, p = np.zeros((s, columns)), p0.copy()
    gain = np.zeros(s)
    for i in range(n):
        if arrived[i]:
            for k in range(m):
                pc = p @ c[k]
                var = r[k]
                for j in range(s):
                    var += c[k, j] * pc[j]
                for j in range(s):
                    gain[j] = pc[j] / var
                root = 1.0 / math.sqrt(var)
                for col in range(columns):
                    e = readings[i, k, col]
                    for j in range(s):
                        e -= c[k, j] * x[j, col]
                    out[i * m + k, col] = e * root
                    for j in range(s):
                        x[j, col] += gain[j] * e
                for j in range(s):
                    for g in range(s):
                        p[j, g] -= gain[j] * pc[g]
        if i < n - 1:
            w = which[i]
            x = a[w] @ x
            for j in range(s):
                for col in range(columns):
                    x[j, col] += b[w, 0, j] * torque[i, col] + b[w, 1, j] * slope[i, col]
            p = a[w] @ p @ a[w].T.copy() + q[w]
            for j in range(s):
                for g in range(s):
                    p[j, g] += doubt[i] * b[w, 0, j] * b[w, 0, g]
            p = 0.5 * (p + p.T)
    return out


@dataclass(frozen=True)
class Filter:
    """The oracle's filter. ``a``, ``b``, ``q`` have one matrix for each length of a step, in fine steps: ``lengths``.

    ``doubt_nm`` is the rms error of the torque column's mean over a step, where both its ends arrived and elsewhere.
    """

    lengths: Any
    a: Any
    b: Any
    q: Any
    p0: Any
    c: Any
    r: Any
    doubt_nm: tuple[float, float]

    def __call__(self, m: Motion, readings: Any, arrived: Any, fine: Sequence[Any]) -> Any:
        """Normalised innovations of one run; ``fine`` are columns of torque in fine steps, N m."""
        which = np.searchsorted(self.lengths, np.diff(m.at))
        mean = np.stack([m.mean(x) for x in fine], axis=1)
        slope = np.stack([m.change(x) for x in fine], axis=1)
        if readings is None:
            readings = np.zeros((len(m.at), len(self.r), len(fine)))
        doubt = np.where(whole_steps(arrived), *self.doubt_nm) ** 2
        return _filtered(self.a, self.b, self.q, which, self.p0, self.c, self.r, readings, arrived, doubt, mean, slope)


def whole_steps(arrived: Any) -> Any:
    """Steps between samples whose ends both arrived, shape (n - 1,)."""
    return arrived[1:] & arrived[:-1]


def _continuous(rig: Rig, size: Levels, disturbance_nm: float, angle_rms: float) -> tuple[Any, Any, Any]:
    """Dynamics, density of the noise that drives them (diagonal), and variance at the start (diagonal)."""
    gyro = rig.sensors != "encoder"
    n = GYRO_STATES if gyro else BIAS
    f, spread, p0 = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    f[TH, W] = 1.0
    f[W, TH], f[W, W] = -rig.stiffness / rig.inertia, -rig.damping / rig.inertia
    f[W, FAST] = f[W, SLOW] = 1.0 / rig.inertia
    p0[TH], p0[W] = (30.0 * angle_rms + math.pi) ** 2, (10.0 * size.rate) ** 2
    relaxing = [(FAST, disturbance_nm**2 * (1.0 - rig.slow_share), 0.5 / math.pi / rig.band_hz)]
    relaxing.append((SLOW, disturbance_nm**2 * rig.slow_share, rig.slow_s))
    if gyro:
        each = (rig.gyro_flicker * size.rate) ** 2 / len(noise.FLICKER_TIMES_S)
        relaxing += [(BIAS + 1 + i, each, time) for i, time in enumerate(noise.FLICKER_TIMES_S)]
        spread[BIAS] = (rig.gyro_walk * size.rate) ** 2
        p0[BIAS] = (0.3 * size.rate) ** 2
    for state, variance, time in relaxing:
        f[state, state] = -1.0 / time
        spread[state] = 2.0 * variance / time
        p0[state] = variance
    return f, spread, p0


def kalman(
    rig: Rig, motions: Sequence[Motion], size: Levels, disturbance_nm: float, doubt_nm: tuple[float, float],
    angle_rms: float,
) -> Filter:  # fmt: skip
    """The filter of a rig at its truth."""
    f, spread, p0 = _continuous(rig, size, disturbance_nm, angle_rms)
    n = len(f)
    lengths = np.unique(np.concatenate([np.diff(m.at) for m in motions]))
    a, b, q = np.zeros((len(lengths), n, n)), np.zeros((len(lengths), 2, n)), np.zeros((len(lengths), n, n))
    for i, length in enumerate(lengths):
        t = float(length) * motions[0].step_s
        block = np.zeros((2 * n, 2 * n))  # Van Loan
        block[:n, :n], block[:n, n:], block[n:, n:] = -f * t, np.diag(spread) * t, f.T * t
        e = expm(block)
        a[i] = e[n:, n:].T
        held = np.zeros((n + 2, n + 2))  # a torque that starts at the second input and changes by the first
        held[:n, :n], held[W, n + 1], held[n + 1, n] = f * t, t / rig.inertia, 1.0
        answer = expm(held)
        b[i, 0] = answer[:n, n + 1]
        b[i, 1] = answer[:n, n] - 0.5 * b[i, 0]
        q[i] = a[i] @ e[:n, n:]
        q[i] = 0.5 * (q[i] + q[i].T)
    rows, r = [], []
    stamped, fine_s = rig.stamp_error * rig.sample_s, motions[0].step_s
    if rig.sensors != "encoder":
        row = np.zeros(n)
        row[W] = 1.0
        row[BIAS:] = 1.0
        rows.append(row)
        r.append(
            rate_noise(rig, size) ** 2 + (stamped * noise.rms_of([np.diff(m.rate) for m in motions]) / fine_s) ** 2
        )
    if rig.sensors != "gyro":
        row = np.zeros(n)
        row[TH] = 1.0
        rows.append(row)
        r.append((2.0 * math.pi / rig.counts) ** 2 / 12.0 + (stamped * size.rate) ** 2)
    return Filter(lengths, a, b, q, np.diag(p0), np.array(rows), np.array(r), doubt_nm)


def rate_noise(rig: Rig, size: Levels) -> float:
    """White noise a sample of the gyro that has the density of its filtered noise at low frequency, rad/s."""
    band = rig.gyro_corner_hz * math.pi / (2.0 * math.sqrt(2.0))  # noise bandwidth of the Butterworth low-pass
    return rig.gyro_noise * size.rate * math.sqrt(max(1.0, 0.5 * rig.sample_hz / band))


def torque_along(rig: Rig, m: Motion, name: str, numbers: Mapping[str, float]) -> Any:
    """Torque in fine steps that an effect takes along a motion, N m."""
    p = np.array([numbers[k] for k in PARAMETERS[name]])
    code = CODES[name]
    torque = m.shaft if code == CODES["sensor_lag"] or code < 200 else m.asked
    return along(code, m.step_s, m.before, m.angle, m.rate, torque, rig.stiffness, p, STATES.get(name, 0))


def motion_columns(m: Motion) -> list[Any]:
    """Acceleration, rate, angle in fine steps (means)."""
    return [np.diff(m.rate) / m.step_s, 0.5 * (m.rate[1:] + m.rate[:-1]), 0.5 * (m.angle[1:] + m.angle[:-1])]


def slopes(rig: Rig, m: Motion, name: str, numbers: Mapping[str, float]) -> list[Any]:
    """Change of an effect's torque with each of its numbers, relative, in fine steps."""
    columns = []
    for key in PARAMETERS[name]:
        change = STEP * abs(numbers[key]) or STEP
        up = torque_along(rig, m, name, {**numbers, key: numbers[key] + change})
        down = torque_along(rig, m, name, {**numbers, key: numbers[key] - change})
        columns.append((up - down) / (2.0 * STEP))
    return columns


def recorded(rig: Rig, m: Motion, seen: Measured) -> Any:
    """The torque column in fine steps: a command held, a current as a spline through what arrived, N m."""
    return _between(rig, m, seen, seen.torque)


def foreseen(rig: Rig, m: Motion, seen: Measured) -> Any:
    """Acceleration in fine steps that the samples of a noiseless torque column foretell, rad/s^2.

    What disturbance and unrecorded ripple add to the acceleration is no help to find J: it comes with the very
    torque that nobody knows.
    """
    exact = seen.torque if rig.torque_column == "command" else m.sampled(m.current)
    return motion_columns(m)[0] + (_between(rig, m, seen, exact) - m.asked - m.disturbance) / rig.inertia


def _between(rig: Rig, m: Motion, seen: Measured, samples: Any) -> Any:
    n = len(m.asked)
    out = m.asked.copy()
    if rig.torque_column == "command":
        out[m.at[0] : n] = np.repeat(samples[:-1], np.diff(m.at))
        return out
    known = seen.arrived if rig.lost_as_rows else np.ones(len(m.at), dtype=bool)
    spline = CubicSpline(m.at[known].astype(float), samples[known])
    out[m.at[0] :] = spline(np.arange(m.at[0], n) + 0.5)
    return out


def whitened(
    motions: Sequence[Motion], seen: Sequence[Measured], filt: Filter, columns: Sequence[Sequence[Any]]
) -> Any:
    """Columns of torque (a list of series in fine steps for each run) as normalised innovations, runs end to end."""
    return np.concatenate([filt(m, None, s.arrived, c) for m, s, c in zip(motions, seen, columns, strict=True)])


def cleared(x: Any, of: Any) -> Any:
    """Columns of x without what the columns of ``of`` can take (least squares)."""
    norm = np.sqrt(np.sum(of**2, axis=0))
    if not np.any(norm > 0.0):
        return x
    basis = of[:, norm > 0.0] / norm[norm > 0.0]
    values, vectors = np.linalg.eigh(basis.T @ basis)
    good = values > 1e-12 * values[-1]
    u = basis @ (vectors[:, good] / np.sqrt(values[good]))
    return x - u @ (u.T @ x)
