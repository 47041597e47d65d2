"""One-step prediction of the motion: simulated, and corrected at every sample (Kalman filter, compiled).

A torque that nobody recorded (current ripple, the floor, a cable) sets a simulated platform off for good. A Kalman
filter in innovations form takes it up: the nonlinear simulator predicts each sample from the one before, the
difference to the measurement corrects angle, rate and an estimate of the slow part of that torque. The gains come from
the linear part of the platform and two noises. With no torque disturbance the gains are zero and the prediction is the
simulation of the whole run (Ljung, System Identification, ch. 7; Astrom, Automatica 16, 1980).

States of the linear part: angle, rate, slow disturbance torque, and what the sensor's own lag still holds back.
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

STATES = 4  # angle, rate, slow disturbance torque, sensor lag
SETTLED = 1e-7  # relative change of a gain from sample to sample below which it is taken for constant
SETTLED_FOR = 20  # samples in a row


@dataclass(frozen=True)
class Noise:
    """Torque disturbance in relation to the sensor's noise, per unit of the sensor's variance.

    Attributes
    ----------
    white
        Density of a white torque, (N m)^2 s over the variance of one reading.
    slow
        Variance of a slow torque (first-order coloured) over the variance of one reading, (N m)^2.
    time_constant_s
        Of the slow torque.
    """

    white: float = 0.0
    slow: float = 0.0
    time_constant_s: float = 1.0

    @property
    def none(self) -> bool:
        """Whether there is no torque disturbance: the prediction is a simulation."""
        return self.white <= 0.0 and self.slow <= 0.0


@dataclass(frozen=True)
class Gains:
    """What an innovation of one adds to the states after every sample, (n, 4), and its variance, (n,)."""

    gain: Array
    variance: Array
    slow_decay: float  # of the slow torque, a sample
    lag_decay: float  # of what the sensor's lag holds back, a sample


@jit
def _onward(phi, q, p, half):  # type: ignore[no-untyped-def]
    """Covariance a sample later, in place: phi p phi' + q. Loops: a call to a matrix library costs more than this."""
    n = len(q)
    for a in range(n):
        for b in range(n):
            half[a, b] = 0.0
            for c in range(n):
                half[a, b] += phi[a, c] * p[c, b]
    for a in range(n):
        for b in range(a + 1):
            total = q[a, b]
            for c in range(n):
                total += half[a, c] * phi[b, c]
            p[a, b] = p[b, a] = total


@jit
def _riccati(phi, q, read, p, keep, first, last, gain, variance):  # type: ignore[no-untyped-def]
    """Gains and innovation variances of samples first..last, for a reading of unit noise of one state."""
    n = len(q)
    g, half = np.zeros(n), np.zeros((n, n))
    calm = 0
    for i in range(first, last + 1):
        if calm < SETTLED_FOR:
            s = 1.0 + p[read, read]
            if not s >= 1.0:
                s = np.inf  # the linear part ran away: nothing is predicted from here
            variance[i] = s
            if keep[i]:
                change = 0.0
                for a in range(n):
                    g[a] = p[a, read]
                    gain[i, a] = g[a] / s
                    if i > first:
                        change = max(change, abs(gain[i, a] - gain[i - 1, a]) - SETTLED * abs(gain[i, a]))
                calm = calm + 1 if change <= 0.0 and i > first else 0
                for a in range(n):
                    for b in range(n):
                        p[a, b] -= g[a] * g[b] / s
            else:
                calm = 0
            _onward(phi, q, p, half)
        elif keep[i]:
            variance[i] = variance[i - 1]
            gain[i, :] = gain[i - 1, :]
        else:  # a sample was lost: what it would have told is missing for a while
            variance[i] = variance[i - 1]
            calm = 0
            _onward(phi, q, p, half)


@lru_cache(maxsize=64)
def _discrete(j: float, c: float, k: float, noise: Noise, lag: float, step_s: float) -> tuple[Array, Array]:
    """Transition and disturbance covariance of the linear part over a sample (van Loan 1978)."""
    f = np.zeros((STATES, STATES))
    f[0, 1] = 1.0
    f[1, :3] = -k / j, -c / j, 1.0 / j
    f[2, 2] = -1.0 / noise.time_constant_s
    if lag > 0.0:
        f[3, 1], f[3, 3] = 1.0 / lag, -1.0 / lag
    density = np.zeros((STATES, STATES))
    density[1, 1] = noise.white / j**2
    density[2, 2] = 2.0 * noise.slow / noise.time_constant_s
    n = STATES if lag > 0.0 else STATES - 1
    big = np.zeros((2 * n, 2 * n))
    big[:n, :n], big[:n, n:], big[n:, n:] = -f[:n, :n], density[:n, :n], f[:n, :n].T
    van_loan = expm(big * step_s)
    phi = np.ascontiguousarray(van_loan[n:, n:].T)
    q = phi @ van_loan[:n, n:]
    return phi, 0.5 * (q + q.T)


def gains_of(
    jck: Array, noise: Noise, step_s: float, rate: bool, lag_s: float, keep: Any, spans: Sequence[tuple[int, int]],
    start_variance: tuple[float, float] = (0.0, 0.0),
) -> Gains:  # fmt: skip
    """Kalman gains along a run.

    Parameters
    ----------
    jck
        Inertia, damping and stiffness of the linear part, (3,).
    rate
        Whether a rate is measured; else an angle.
    lag_s
        Time constant of the sensor.
    keep
        (n,) boolean: samples that were measured.
    spans
        First and last sample of every stretch.
    """
    tau, lag = noise.time_constant_s, max(lag_s, 0.0)
    phi, q = _discrete(*jck.tolist(), noise, lag, step_s)
    read = 0 if not rate else (3 if lag > 0.0 else 1)
    n = len(q)
    gain, variance = np.zeros((len(keep), STATES)), np.ones(len(keep))
    for first, last in spans:
        p = np.zeros((n, n))
        p[0, 0], p[1, 1], p[2, 2] = start_variance[0], start_variance[1], noise.slow
        if lag > 0.0:
            p[3, 3] = p[1, 3] = p[3, 1] = p[1, 1]
        _riccati(phi, q, read, p, keep, first, last, gain, variance)
    slow_decay = float(np.exp(-step_s / tau))
    return Gains(gain, variance, slow_decay, float(np.exp(-step_s / lag)) if lag > 0.0 else 0.0)


@jit
def _predict(  # type: ignore[no-untyped-def]
    starts, spans, offset_s, z, h, ratio, torque, jck, kernels, loads, z_at, p, p_at, kinks,
    filters, fs, fs_at, fp, fp_at, measured, keep, gain, slow_decay, lag_decay, rate, bias, out, state,
):  # fmt: skip
    n_states = len(z)
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
        slow, held = 0.0, 0.0
        fs[:] = 0.0
        still = motion[1]
        sensed = motion[1]
        for i in range(first, last + 1):
            y = motion[0]
            if rate:
                y = sensed + held + bias
            out[i] = y
            if keep[i]:
                e = measured[i] - y
                motion[0] += gain[i, 0] * e
                motion[1] += gain[i, 1] * e
                slow += gain[i, 2] * e
                held += gain[i, 3] * e
                if frictions and gain[i, 1] != 0.0:
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
                sensed = motion[1] - still
                for f in range(len(filters)):
                    sensed = call_filter(
                        filters[f], sensed, h, offset(pointer(fs), fs_at[f]), offset(pointer(fp), fp_at[f])
                    )  # fmt: skip
                sensed += still
            slow *= slow_decay
            held *= lag_decay
            if not abs(motion[0]) < 1e9:
                out[i + 1 : last + 1] = np.nan
                break
    return room[0, 0]


def predict_ahead(
    equations: Equations, torque: Array, step_s: float, ratio: int, spans: Sequence[tuple[int, int]], starts: Array,
    measured: Array, keep: Any, gains: Gains, rate: bool, bias: float, offset_s: float = 0.0,
    readings: Readings | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Every reading predicted from those before it, (n,), and angle, rate and slow torque after it, (n, 3).

    Parameters
    ----------
    torque
        Shaft torque at start, middle and end of each fine step, (m, 3).
    step_s, ratio
        The fine step, and how many make a sample.
    spans
        First and last sample of every stretch; each begins from its row of ``starts`` (angle, rate).
    measured, keep
        The readings, (n,), and which of them were measured.
    """
    p, _kept = equations.parameters_with(readings)
    filters, fs, fs_at, fp, fp_at = equations.sensor.arrays(step_s)
    out, state = np.zeros(len(measured)), np.zeros((len(measured), 3))
    _predict(
        np.ascontiguousarray(starts), np.array(spans, dtype=np.int64).reshape(-1, 2), offset_s,
        equations.rest_states(*starts[0]), step_s, ratio, torque, equations.jck, equations.kernels, equations.loads,
        equations.z_at, p, equations.p_at, equations.kinks, filters, fs, fs_at, fp, fp_at, measured, keep, gains.gain,
        gains.slow_decay, gains.lag_decay, rate, bias, out, state,
    )  # fmt: skip
    return out, state
