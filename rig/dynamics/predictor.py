"""One-step prediction of the motion: simulated, and corrected at every sample (Kalman filter, compiled).

A torque that nobody recorded (current ripple, the floor, a cable) sets a simulated platform off for good. A Kalman
filter in innovations form takes it up: the nonlinear simulator predicts each sample from the one before, the
difference to the measurement corrects angle, rate and an estimate of the slow part of that torque. The gains come from
the linear part of the platform and two noises. With no torque disturbance the gains are zero and the prediction is the
simulation of the whole run (Ljung, System Identification, ch. 7; Astrom, Automatica 16, 1980).

A gyro and an encoder are two readings of one state, taken one after the other at every sample.

States of the linear part: angle, rate, slow disturbance torque, the sensor's output and its slope (what its low-pass
still holds back), and the gyro's bias, which walks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import expm

from rig.arrays import Array
from rig.dynamics.equations import Equations, Readings
from rig.dynamics.integrator import jit, step_over_kinks
from rig.dynamics.native import call_filter, offset, pointer

STATES = 6  # angle, rate, slow disturbance torque, sensor output, its slope, bias
ANGLE, RATE, SLOW, SENSED, SLOPE, BIAS = range(STATES)
SETTLED = 1e-5  # relative change of a gain from sample to sample below which it is taken for constant
SMALL = 1e-2  # gain of the bias: it settles as slowly as the bias walks, and is small by then
SETTLED_FOR = 20  # samples in a row


@dataclass(frozen=True)
class Noise:
    """Torque disturbance and walk of the gyro's bias in relation to the sensor's noise, per unit of its variance.

    Attributes
    ----------
    white
        Density of a white torque, (N m)^2 s over the variance of one reading.
    slow
        Variance of a slow torque (first-order coloured) over the variance of one reading, (N m)^2.
    time_constant_s
        Of the slow torque.
    walk
        Density of the steps of the gyro's bias, (rad/s)^2 / s over the variance of one reading.
    ahead
        Density of the gyro's white noise ahead of its low-pass, (rad/s)^2 s over the variance of one reading.
    """

    white: float = 0.0
    slow: float = 0.0
    time_constant_s: float = 1.0
    walk: float = 0.0
    ahead: float = 0.0

    @property
    def none(self) -> bool:
        """Whether there is no torque disturbance: the prediction is a simulation."""
        return self.white <= 0.0 and self.slow <= 0.0


@dataclass(frozen=True)
class Sensing:
    """What is read of the platform at every sample, one after the other.

    Attributes
    ----------
    rate
        Whether a gyro reads the rate.
    angle_variance
        Of an encoder's reading: over that of the gyro's beside it, one where the encoder is alone; zero without one.
    lag
        Coefficients of s and of s^2 in the denominator of the gyro's low-pass, s and s^2; zeros without one.
    bias_variance
        Of the gyro's bias at the start, over the variance of its reading.
    """

    rate: bool
    angle_variance: float = 0.0
    lag: tuple[float, float] = (0.0, 0.0)
    bias_variance: float = 0.0

    @property
    def readings(self) -> int:
        """How many there are at every sample."""
        return int(self.rate) + int(self.angle_variance > 0.0)


@dataclass(frozen=True)
class Gains:
    """What an innovation of one adds to the states after every sample, (n, m, 6), and its variance, (n, m)."""

    gain: Array
    variance: Array
    slow_decay: float  # of the slow torque, a sample
    onward: Array  # the linear part over a sample, (6, 6)
    reads: Array  # what each reading is of the states, (m, 6)

    @property
    def held(self) -> Array:
        """What a sample leaves of the sensor's output and slope, (2, 2)."""
        return np.ascontiguousarray(self.onward[SENSED : SLOPE + 1, SENSED : SLOPE + 1])


@jit
def _onward(phi, q, p, half):  # type: ignore[no-untyped-def]
    """Covariance a sample later, in place: phi p phi' + q. Loops: a call to a matrix library costs more than this."""
    n = len(q)
    for a in range(n):
        for b in range(n):
            half[a, b] = 0.0
            for c in range(n):
                if phi[a, c] != 0.0:
                    half[a, b] += phi[a, c] * p[c, b]
    for a in range(n):
        for b in range(a + 1):
            total = q[a, b]
            for c in range(n):
                if phi[b, c] != 0.0:
                    total += half[a, c] * phi[b, c]
            p[a, b] = p[b, a] = total


@jit
def _riccati(  # type: ignore[no-untyped-def]
    phi, q, reads, noises, p, keep, first, last, gain, variance, bias, small
):  # fmt: skip
    """Gains and innovation variances of samples first..last, for readings of the states ``reads`` (m, n)."""
    n, m = len(q), len(reads)
    g, half = np.zeros(n), np.zeros((n, n))
    calm = 0
    for i in range(first, last + 1):
        if calm < SETTLED_FOR:
            change = 0.0
            for k in range(m):
                s = noises[k]
                for a in range(n):
                    g[a] = 0.0
                    for b in range(n):
                        if reads[k, b] != 0.0:
                            g[a] += p[a, b] * reads[k, b]
                for a in range(n):
                    s += reads[k, a] * g[a]
                if not s >= noises[k]:
                    s = np.inf  # the linear part ran away: nothing is predicted from here
                variance[i, k] = s
                if keep[i]:
                    for a in range(n):
                        gain[i, k, a] = g[a] / s
                        if i > first:
                            least = small if a == bias else 0.0
                            change = max(
                                change, abs(gain[i, k, a] - gain[i - 1, k, a]) - SETTLED * (abs(gain[i, k, a]) + least)
                            )
                    for a in range(n):
                        for b in range(n):
                            p[a, b] -= g[a] * g[b] / s
            calm = calm + 1 if keep[i] and change <= 0.0 and i > first else 0
            _onward(phi, q, p, half)
        elif keep[i]:
            variance[i] = variance[i - 1]
            gain[i] = gain[i - 1]
        else:  # a sample was lost: what it would have told is missing for a while
            variance[i] = variance[i - 1]
            calm = 0
            _onward(phi, q, p, half)


@lru_cache(maxsize=64)
def _discrete(
    j: float, c: float, k: float, noise: Noise, lag: tuple[float, float], step_s: float
) -> tuple[Array, Array]:  # fmt: skip
    """Transition and disturbance covariance of the linear part over a sample (van Loan 1978), (6, 6) each.

    States that are not there (a low-pass of first order has no slope) keep nothing and get nothing.
    """
    f, density = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    f[ANGLE, RATE] = 1.0
    f[RATE, :3] = -k / j, -c / j, 1.0 / j
    f[SLOW, SLOW] = -1.0 / noise.time_constant_s
    first, second = lag
    there = [ANGLE, RATE, SLOW, BIAS]
    if second > 0.0:
        f[SENSED, SLOPE] = 1.0
        f[SLOPE, RATE], f[SLOPE, SENSED], f[SLOPE, SLOPE] = 1.0 / second, -1.0 / second, -first / second
        density[SLOPE, SLOPE] = noise.ahead / second**2
        there += [SENSED, SLOPE]
    elif first > 0.0:
        f[SENSED, RATE], f[SENSED, SENSED] = 1.0 / first, -1.0 / first
        density[SENSED, SENSED] = noise.ahead / first**2
        there.append(SENSED)
    density[RATE, RATE] = noise.white / j**2
    density[SLOW, SLOW] = 2.0 * noise.slow / noise.time_constant_s
    density[BIAS, BIAS] = noise.walk
    at = np.ix_(sorted(there), sorted(there))
    n = len(there)
    big = np.zeros((2 * n, 2 * n))
    big[:n, :n], big[:n, n:], big[n:, n:] = -f[at], density[at], f[at].T
    van_loan = expm(big * step_s)
    phi, q = np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    phi[at] = van_loan[n:, n:].T
    q[at] = phi[at] @ van_loan[:n, n:]
    return np.ascontiguousarray(phi), 0.5 * (q + q.T)


def gains_of(
    jck: Array, noise: Noise, step_s: float, sensing: Sensing, keep: Any, spans: Sequence[tuple[int, int]],
    start_variance: tuple[float, float] = (0.0, 0.0),
) -> Gains:  # fmt: skip
    """Kalman gains along a run.

    Parameters
    ----------
    jck
        Inertia, damping and stiffness of the linear part, (3,).
    sensing
        What is read.
    keep
        (n,) boolean: samples that were measured.
    spans
        First and last sample of every stretch.
    start_variance
        Of angle and rate at the start of a stretch, over that of one reading.
    """
    phi, q = _discrete(*jck.tolist(), noise, sensing.lag, step_s)
    lagging = sensing.lag[0] > 0.0
    reads, noises = [], []
    if sensing.rate:
        row = np.zeros(STATES)
        row[SENSED if lagging else RATE] = row[BIAS] = 1.0
        reads.append(row)
        noises.append(1.0)
    if sensing.angle_variance > 0.0:
        row = np.zeros(STATES)
        row[ANGLE] = 1.0
        reads.append(row)
        noises.append(sensing.angle_variance)
    start = np.zeros((STATES, STATES))
    start[ANGLE, ANGLE], start[RATE, RATE], start[SLOW, SLOW] = start_variance[0], start_variance[1], noise.slow
    if sensing.rate:
        start[BIAS, BIAS] = sensing.bias_variance
    if lagging:
        start[SENSED, SENSED] = start[RATE, SENSED] = start[SENSED, RATE] = start[RATE, RATE]
    # A state that is neither read, nor driven, nor unknown at the start needs no arithmetic.
    there = np.flatnonzero((np.arange(STATES) <= SLOW) | (np.diag(q) > 0.0) | (np.diag(start) > 0.0))
    at = np.ix_(there, there)
    few, driven, seen = np.ascontiguousarray(phi[at]), np.ascontiguousarray(q[at]), np.array(reads)[:, there]
    m, n = len(reads), len(there)
    bias = n - 1 if there[-1] == BIAS else -1
    gain, variance = np.zeros((len(keep), m, n)), np.ones((len(keep), m))
    for begin, last in spans:
        _riccati(few, driven, seen, np.array(noises), start[at].copy(), keep, begin, last, gain, variance, bias, SMALL)
    whole = np.zeros((len(keep), m, STATES))
    whole[:, :, there] = gain
    return Gains(whole, variance, float(np.exp(-step_s / noise.time_constant_s)), phi, np.array(reads))


@jit
def _follow(spans, e, slow, keep, gain, other, phi, reads, decay, new_decay, bias, out):  # type: ignore[no-untyped-def]
    states, readings = len(phi), len(reads)
    d, ahead = np.zeros(states), np.zeros(states)
    for k in range(len(spans)):
        d[:] = 0.0
        for i in range(spans[k, 0], spans[k, 1] + 1):
            for m in range(readings):
                moved = e[i, m] - bias * reads[m, states - 1]  # what the last state, the bias, stands for
                for a in range(states):
                    moved -= reads[m, a] * d[a]
                out[i, m] = moved
                if keep[i]:
                    for a in range(states):
                        d[a] += other[i, m, a] * moved - gain[i, m, a] * e[i, m]
            for a in range(states):
                ahead[a] = 0.0
                for b in range(states):
                    if phi[a, b] != 0.0:
                        ahead[a] += phi[a, b] * d[b]
            ahead[2] += (new_decay - decay) * slow[i]
            d[:] = ahead


def innovations_with(
    gains: Gains, other: Gains, innovations: Array, slow_torque: Array, keep: Any, spans: Sequence[tuple[int, int]],
    bias: float = 0.0,
) -> Array:  # fmt: skip
    """What the innovations would be with other gains, (n, m), the platform taken for linear between the two.

    Parameters
    ----------
    gains, innovations, slow_torque
        Of a prediction: its gains, its innovations (n, m), and its slow disturbance torque after every sample, (n,).
    other
        The other gains, of the same platform with another noise.
    bias
        By how much the gyro's bias is another.
    """
    out = np.empty_like(innovations)
    _follow(
        np.array(spans, dtype=np.int64).reshape(-1, 2), innovations, np.ascontiguousarray(slow_torque), keep,
        gains.gain, other.gain, other.onward, other.reads, gains.slow_decay, other.slow_decay, bias, out,
    )  # fmt: skip
    return out


@jit
def _predict(  # type: ignore[no-untyped-def]
    starts, spans, offset_s, z, h, ratio, torque, jck, kernels, loads, z_at, p, p_at, kinks,
    filters, fs, fs_at, fp, fp_at, measured, keep, gain, slow_decay, decay, rate, bias, out, state,
):  # fmt: skip
    n_states, readings = len(z), measured.shape[1]
    room = np.zeros((10, max(4, n_states)))
    work = (
        pointer(room[0]), pointer(room[1]), pointer(room[2]),
        pointer(room[3]), pointer(room[4]), pointer(room[5]),
    )  # fmt: skip
    saved, before, bends = pointer(room[6]), pointer(room[8:]), pointer(kinks)
    motion = np.empty(4)
    mo, zp = pointer(motion), pointer(z)
    jck3 = (jck[0], jck[1], jck[2])
    body = (loads, len(kernels), pointer(kernels), pointer(z_at), pointer(p), pointer(p_at))
    frictions = len(kernels) > loads
    for k in range(len(spans)):
        first, last = spans[k, 0], spans[k, 1]
        motion[0], motion[1], motion[2] = starts[k, 0], starts[k, 1], np.sign(starts[k, 1])
        motion[3] = offset_s + first * ratio * h
        slow, held, slope, walked = 0.0, 0.0, 0.0, 0.0
        # A correction of the rate is a jump. The filters see the rate without its jumps, and the sum of these passes
        # the linear low-pass with what the low-pass holds back.
        jumps = 0.0
        fs[:] = 0.0
        still = motion[1]
        sensed = motion[1]
        for i in range(first, last + 1):
            for m in range(readings):
                y = sensed + held + bias + walked if rate and m == 0 else motion[0]
                out[i, m] = y
                if keep[i]:
                    e = measured[i, m] - y
                    motion[0] += gain[i, m, 0] * e
                    motion[1] += gain[i, m, 1] * e
                    jumps += gain[i, m, 1] * e
                    slow += gain[i, m, 2] * e
                    held += gain[i, m, 3] * e
                    slope += gain[i, m, 4] * e
                    walked += gain[i, m, 5] * e
                    if frictions and gain[i, m, 1] != 0.0:
                        motion[2] = np.sign(motion[1])
            state[i, 0], state[i, 1], state[i, 2] = motion[0], motion[1], slow
            if i == last:
                break
            for s in range(i * ratio, (i + 1) * ratio):
                step_over_kinks(
                    mo, n_states, zp, work, saved, h, torque[s, 0] + slow, torque[s, 1] + slow, torque[s, 2] + slow,
                    jck3, body, bends, len(kinks), before,
                )  # fmt: skip
                motion[3] = offset_s + (s + 1) * h
                sensed = motion[1] - jumps - still
                for f in range(len(filters)):
                    sensed = call_filter(
                        filters[f], sensed, h, offset(pointer(fs), fs_at[f]), offset(pointer(fp), fp_at[f])
                    )  # fmt: skip
                sensed += still
            slow *= slow_decay
            held -= jumps
            held, slope = decay[0, 0] * held + decay[0, 1] * slope, decay[1, 0] * held + decay[1, 1] * slope
            held += jumps
            if not abs(motion[0]) < 1e9:
                out[i + 1 : last + 1] = np.nan
                break
    return room[0, 0]


def predict_ahead(
    equations: Equations, torque: Array, step_s: float, ratio: int, spans: Sequence[tuple[int, int]], starts: Array,
    measured: Array, keep: Any, gains: Gains, rate: bool, bias: float, offset_s: float = 0.0,
    readings: Readings | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Every reading predicted from those before it, (n, m), and angle, rate and slow torque after it, (n, 3).

    Parameters
    ----------
    torque
        Shaft torque at start, middle and end of each fine step, (m, 3).
    step_s, ratio
        The fine step, and how many make a sample.
    spans
        First and last sample of every stretch; each begins from its row of ``starts`` (angle, rate).
    measured, keep
        The readings, (n, m), and which samples were measured, (n,). A gyro's reading stands before an encoder's.
    """
    p, _kept = equations.parameters_with(readings)
    filters, fs, fs_at, fp, fp_at = equations.sensor.arrays(step_s)
    out, state = np.zeros(measured.shape), np.zeros((len(measured), 3))
    _predict(
        np.ascontiguousarray(starts), np.array(spans, dtype=np.int64).reshape(-1, 2), offset_s,
        equations.rest_states(*starts[0]), step_s, ratio, torque, equations.jck, equations.kernels, equations.loads,
        equations.z_at, p, equations.p_at, equations.kinks, filters, fs, fs_at, fp, fp_at, measured, keep, gains.gain,
        gains.slow_decay, gains.held, rate, bias, out, state,
    )  # fmt: skip
    return out, state
