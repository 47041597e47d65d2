"""Kalman gains along a run, of the linear part of a platform, and the innovations that other gains would have left.

The gains come from inertia, damping and stiffness and two noises, by the Riccati recursion (``rig.dynamics.riccati``).

States of the linear part: angle, rate, coloured disturbance torque and where that is heading, the sensor's output and
its slope (what its low-pass still holds back), the gyro's bias, which walks, and the states of linear effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from rig.arrays import Array
from rig.dynamics.linear_part import LinearPart
from rig.dynamics.native import jit
from rig.dynamics.over_a_sample import over_a_sample
from rig.dynamics.riccati import riccati

STATES = 7  # angle, rate, disturbance torque and what it is heading for, sensor output, its slope, bias; effects behind
ANGLE, RATE, TORQUE, AIM, SENSED, SLOPE, BIAS = range(STATES)


@dataclass(frozen=True)
class Noise:
    """Torque disturbance and walk of the gyro's bias in relation to the sensor's noise, per unit of its variance.

    Attributes
    ----------
    white
        Density of a white torque, (N m)^2 s over the variance of one reading.
    slow
        Variance of a slow torque (first-order coloured: rough) over the variance of one reading, (N m)^2.
    time_constant_s
        Of the slow torque, and of the smooth one.
    walk
        Density of the steps of the gyro's bias, (rad/s)^2 / s over the variance of one reading; where an encoder is
        alone, of the steps of its error, rad^2 / s.
    walk_s
        Time constant with which that returns to nothing; infinite: never.
    ahead
        Variance of what a gyro's low-pass lets through of the white noise ahead of it, over the variance of one
        reading. Behind a quick low-pass that is white as well.
    smooth
        Variance of a smooth torque (second-order coloured: it has a slope) over the variance of one reading, (N m)^2.
    """

    white: float = 0.0
    slow: float = 0.0
    time_constant_s: float = 1.0
    walk: float = 0.0
    ahead: float = 0.0
    walk_s: float = float("inf")
    smooth: float = 0.0

    @property
    def none(self) -> bool:
        """Whether there is no torque disturbance: the prediction is a simulation."""
        return self.white <= 0.0 and self.slow <= 0.0 and self.smooth <= 0.0

    @property
    def kicks(self) -> tuple[float, float]:
        """What one white noise of unit density does to the coloured torque and to what it is heading for, a second.

        The spectra of the slow and of the smooth torque add up to that of one process of second order (spectral
        factorisation): (smooth + slow (1 + w^2 T^2)) / (1 + w^2 T^2)^2, each with its own scale.
        """
        time = self.time_constant_s
        still, rough = np.sqrt(4.0 * time * self.smooth + 2.0 * time * self.slow), np.sqrt(2.0 * self.slow / time)
        return float(rough), float(still / time - rough)

    @property
    def coloured(self) -> Array:
        """Covariance of the coloured torque and of what it is heading for, long after they began, (2, 2)."""
        time, (torque, aim) = self.time_constant_s, self.kicks
        ahead = 0.5 * aim**2 * time
        both = 0.5 * (ahead + torque * aim * time)
        return np.array([[both + 0.5 * torque**2 * time, both], [both, ahead]])


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


class StartVariance(NamedTuple):
    """Of the motion where a stretch begins, over the variance of one reading.

    Angle and rate are known as closely as that; of the others this is how large they are along the motion.
    """

    angle: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    moving_rate: float = 0.0


@dataclass(frozen=True)
class Gains:
    """What an innovation of one adds to the states after every sample, (n, m, 7 + s), and its variance, (n, m).

    The last s are the states of linear effects.
    """

    gain: Array
    variance: Array
    onward: Array  # the linear part over a sample, (7 + s, 7 + s)
    reads: Array  # what each reading is of the states, (m, 7 + s)
    of_effects: Array  # which internal states of the platform the last ones are, (s,)

    @property
    def coloured(self) -> Array:
        """What a sample makes of the coloured torque and of what it is heading for, (2, 2)."""
        return np.ascontiguousarray(self.onward[TORQUE : AIM + 1, TORQUE : AIM + 1])

    @property
    def walk_decay(self) -> float:
        """Of the reading's slow error, a sample."""
        return float(self.onward[BIAS, BIAS])

    @property
    def held(self) -> Array:
        """What a sample leaves of the sensor's output and slope, (2, 2)."""
        return np.ascontiguousarray(self.onward[SENSED : SLOPE + 1, SENSED : SLOPE + 1])


@lru_cache(maxsize=64)
def _discrete(linear: LinearPart, noise: Noise, lag: tuple[float, float], step_s: float) -> tuple[Array, Array]:
    """Transition and disturbance covariance of the linear part over a sample, (7 + s, 7 + s) each.

    States that are not there (a low-pass of first order has no slope) keep nothing and get nothing.
    """
    j, every = linear.inertia, STATES + len(linear.states)
    f, density = np.zeros((every, every)), np.zeros((every, every))
    f[ANGLE, RATE] = 1.0
    f[RATE, :3] = -linear.stiffness / j, -linear.damping / j, 1.0 / j
    if linear.states:
        f[RATE, STATES:] = -np.array(linear.torque) / j
        f[STATES:, :2], f[STATES:, STATES:] = linear.by_motion, linear.by_states
    time = noise.time_constant_s
    f[TORQUE, TORQUE], f[TORQUE, AIM], f[AIM, AIM] = -1.0 / time, 1.0 / time, -1.0 / time
    first, second = lag
    there = [ANGLE, RATE, TORQUE, AIM, BIAS, *range(STATES, every)]
    if second > 0.0:
        f[SENSED, SLOPE] = 1.0
        f[SLOPE, RATE], f[SLOPE, SENSED], f[SLOPE, SLOPE] = 1.0 / second, -1.0 / second, -first / second
        density[SLOPE, SLOPE] = 2.0 * first * noise.ahead / second**2
        there += [SENSED, SLOPE]
    elif first > 0.0:
        f[SENSED, RATE], f[SENSED, SENSED] = 1.0 / first, -1.0 / first
        density[SENSED, SENSED] = 2.0 * noise.ahead / first
        there.append(SENSED)
    density[RATE, RATE] = noise.white / j**2
    density[TORQUE : AIM + 1, TORQUE : AIM + 1] = np.outer(noise.kicks, noise.kicks)
    f[BIAS, BIAS] = -1.0 / noise.walk_s
    density[BIAS, BIAS] = noise.walk
    at = np.ix_(sorted(there), sorted(there))
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(density))):  # no platform, and nothing to be told of it
        return np.full_like(f, np.nan), np.full_like(f, np.nan)
    onward, driven = np.empty((len(there), len(there))), np.empty((len(there), len(there)))
    over_a_sample(f[at], density[at], step_s, onward, driven)
    phi, q = np.zeros((every, every)), np.zeros((every, every))
    phi[at], q[at] = onward, driven
    return phi, q


@lru_cache(maxsize=64)
def _inside(linear: LinearPart, begun: StartVariance) -> Array:
    """Covariance of what the states of linear effects are beside rest in a motion of that size, (s, s).

    A payload on a soft mount swings against the shaft by what its acceleration has been, a spring has crept by what the
    rate has been. Rate and acceleration are taken for noise that changes as fast as they do on average.
    """
    own, rest = np.array(linear.by_states), np.array(linear.at_rest)
    by_rate = own @ rest[:, 1] + np.array(linear.by_motion)[:, 1] - rest[:, 0]
    slow, fast = (
        2.0 * size * np.sqrt(size / change) if change > 0.0 else 0.0
        for size, change in ((begun.moving_rate, begun.acceleration), (begun.acceleration, begun.jerk))
    )
    driven = slow * np.outer(by_rate, by_rate) + fast * np.outer(rest[:, 1], rest[:, 1])
    if not np.all(np.isfinite(own)) or np.max(np.linalg.eigvals(own).real) >= 0.0:
        return np.zeros_like(own)  # what does not settle has no size
    opens = np.flatnonzero(~np.array(linear.begin_at_rest))
    out = np.zeros_like(own)
    out[np.ix_(opens, opens)] = solve_continuous_lyapunov(own, -driven)[np.ix_(opens, opens)]
    return out


def gains_of(
    linear: LinearPart, noise: Noise, step_s: float, sensing: Sensing, keep: Any, spans: Sequence[tuple[int, int]],
    begun: StartVariance = StartVariance(),  # noqa: B008  immutable
    in_motion: Sequence[bool] = (),
) -> Gains:  # fmt: skip
    """Kalman gains along a run.

    Parameters
    ----------
    linear
        The linear part of the platform.
    sensing
        What is read.
    keep
        (n,) boolean: samples that were measured.
    spans
        First and last sample of every stretch.
    begun
        How well the start of a stretch is known. It is read off what a low-pass has let through. What that holds back
        is its first coefficient times the acceleration and its second times the jerk, and nobody knows those.
    in_motion
        Whether each stretch begins in motion, (spans,); at rest where nothing is said.
    """
    phi, q = _discrete(linear, noise, sensing.lag, step_s)
    every = len(phi)
    lagging = sensing.lag[0] > 0.0
    reads, noises = [], []
    if sensing.rate:
        row = np.zeros(every)
        row[SENSED if lagging else RATE] = row[BIAS] = 1.0
        reads.append(row)
        noises.append(1.0)
    if sensing.angle_variance > 0.0:
        row = np.zeros(every)
        row[ANGLE] = 1.0
        row[BIAS] = 0.0 if sensing.rate else 1.0
        reads.append(row)
        noises.append(sensing.angle_variance)
    start = np.zeros((every, every))
    start[ANGLE, ANGLE], start[RATE, RATE] = begun.angle, begun.rate
    start[TORQUE : AIM + 1, TORQUE : AIM + 1] = noise.coloured
    if sensing.rate:
        start[BIAS, BIAS] = sensing.bias_variance
    elif noise.walk > 0.0:
        start[BIAS, BIAS] = 0.5 * noise.walk * noise.walk_s
    if lagging:
        first, second = sensing.lag
        start[RATE, SENSED] = start[SENSED, RATE] = start[SENSED, SENSED] = begun.rate
        start[RATE, RATE] += first**2 * begun.acceleration + second**2 * begun.jerk
        if second > 0.0:
            start[SLOPE, SLOPE] = begun.acceleration
            start[RATE, SLOPE] = start[SLOPE, RATE] = first * begun.acceleration
    if linear.states:
        rest = np.array(linear.at_rest)  # they follow angle and rate, whatever is known of those
        start[STATES:, :STATES] = rest @ start[:2, :STATES]
        start[:STATES, STATES:] = start[STATES:, :STATES].T
        start[STATES:, STATES:] = rest @ start[:2, :2] @ rest.T
    # A state that is neither read, nor driven, nor unknown at the start needs no arithmetic.
    there = np.flatnonzero(
        (np.arange(every) <= TORQUE) | (np.arange(every) >= STATES) | (np.diag(q) > 0.0) | (np.diag(start) > 0.0)
    )
    at = np.ix_(there, there)
    few, driven, seen = np.ascontiguousarray(phi[at]), np.ascontiguousarray(q[at]), np.array(reads)[:, there]
    m, n = len(reads), len(there)
    gain, variance = np.zeros((len(keep), m, n)), np.ones((len(keep), m))
    for k, (begin, last) in enumerate(spans):
        begins = start.copy()
        if linear.states and k < len(in_motion) and in_motion[k]:
            begins[STATES:, STATES:] += _inside(linear, begun)
        riccati(few, driven, seen, np.array(noises), begins[at], keep, begin, last, gain, variance)
    whole = np.zeros((len(keep), m, every))
    whole[:, :, there] = gain
    return Gains(whole, variance, phi, np.array(reads), np.array(linear.states, dtype=np.int64))


@jit
def _follow(spans, e, state, keep, gain, other, phi, reads, coloured, walk_decay, bias, out):  # type: ignore[no-untyped-def]
    states, readings = len(phi), len(reads)
    d, ahead = np.zeros(states), np.zeros(states)
    for k in range(len(spans)):
        d[:] = 0.0
        for i in range(spans[k, 0], spans[k, 1] + 1):
            for m in range(readings):
                moved = e[i, m] - bias * reads[m, BIAS]
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
            for a in range(2):
                for b in range(2):
                    ahead[TORQUE + a] += (phi[TORQUE + a, TORQUE + b] - coloured[a, b]) * state[i, TORQUE + b]
            ahead[BIAS] += (phi[BIAS, BIAS] - walk_decay) * state[i, AIM + 1]
            for a in range(states):  # an assignment to a slice compiles for seconds
                d[a] = ahead[a]


def innovations_with(
    gains: Gains, other: Gains, innovations: Array, state: Array, keep: Any, spans: Sequence[tuple[int, int]],
    bias: float = 0.0,
) -> Array:  # fmt: skip
    """What the innovations would be with other gains, (n, m), the platform taken for linear between the two.

    Parameters
    ----------
    gains, innovations, state
        Of a prediction: its gains, its innovations (n, m), and its states after every sample, (n, 5).
    other
        The other gains, of the same platform with another noise.
    bias
        By how much the gyro's bias is another.
    """
    out = np.empty_like(innovations)
    _follow(
        np.array(spans, dtype=np.int64).reshape(-1, 2), innovations, state, keep, gains.gain, other.gain, other.onward,
        other.reads, gains.coloured, gains.walk_decay, bias, out,
    )  # fmt: skip
    return out
