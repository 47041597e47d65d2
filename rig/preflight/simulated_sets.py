"""Sets simulated on the declared platform: travel, rate and torque of one set, and of all sets in sequence.

Without a restoring spring every set begins where the one before it left the platform, so that travel adds up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.excitation import PlannedSet
from rig.platform import Platform

PEAK_RATE_HZ = 4000.0  # the crest of a 29 Hz ring read at 4 kHz is low by 0.03 %
MIN_SAMPLES_A_RING_PERIOD = 138.0  # of a ring, for that: 4000 / 29
LONG_SAMPLES = 400_000  # 100 s at 4 kHz; a simulation with corners in its torque keeps about 500 bytes for each
STRAIGHT = 1e-3  # of the largest torque: as far as a sine bends between 70 samples a period
COAST_RATE_HZ = 200.0  # only the end of a rest is used, and the integrator chooses its own substeps
SETTLED_TIME_CONSTANTS = 3.0  # time constants after which a spring has pulled it back
BISECTIONS = 24  # halvings: the factor to 6e-8
State = tuple[float, float]
AT_ORIGIN: State = (0.0, 0.0)


class Peaks(NamedTuple):
    """Largest absolute values over a set; infinite where the platform runs away."""

    travel_deg: float
    rate_deg_s: float
    torque_nm: float

    def within(self, allowed: Peaks) -> bool:
        """Whether no value is above its limit."""
        return all(value <= limit for value, limit in zip(self, allowed, strict=True))


class SetMotion(NamedTuple):
    """One set as it begins somewhere: the angle it begins at, its peaks from the origin, and how it ends."""

    starts_deg: float
    peaks: Peaks
    end: State


class SetForecast:
    """One set on one platform, ready to be simulated at several amplitudes, from anywhere."""

    def __init__(self, platform: Platform, planned_set: PlannedSet) -> None:
        self._equations = Equations(platform)
        time_s, self._torque_nm = _sampled(planned_set, self._equations.fastest_rad_s() / (2.0 * math.pi))
        substeps = self._equations.substeps(float(time_s[1] - time_s[0]))
        self._grid = Grid(time_s, TorqueSignal(time_s, self._torque_nm), substeps)

    def play(self, scale: float, start: State = AT_ORIGIN) -> SetMotion:
        """The set at this amplitude, from this angle in rad and rate in rad/s."""
        with np.errstate(all="ignore"):
            motion = self._grid.scaled(scale).simulate(self._equations, start)
        peaks = Peaks(
            math.degrees(_peak(motion.angle_rad)), math.degrees(_peak(motion.rate_rad_s)),
            _peak(scale * self._torque_nm),
        )  # fmt: skip
        return SetMotion(math.degrees(start[0]), peaks, (float(motion.angle_rad[-1]), float(motion.rate_rad_s[-1])))


def peak_torque_nm(planned_set: PlannedSet) -> float:
    """Largest torque of a set, as its forecast has it."""
    return _peak(_sampled(planned_set)[1])


def _sampled(planned_set: PlannedSet, fastest_hz: float = math.inf) -> tuple[Array, Array]:
    """Time and torque of a set, each (n,), for a platform that rings at most so fast.

    Of a long set every second instant is left out as long as neither the platform nor the torque needs it: a slow
    platform is asked for sets of many minutes.
    """
    rate_hz = PEAK_RATE_HZ
    while True:
        time_s: Array = np.arange(math.ceil(planned_set.duration_s * rate_hz) + 1) / rate_hz
        torque_nm = np.asarray(planned_set.torque(time_s), dtype=float)
        slow = rate_hz >= 2.0 * MIN_SAMPLES_A_RING_PERIOD * fastest_hz
        if len(time_s) <= LONG_SAMPLES or not slow or not _is_straight(torque_nm):
            return time_s, torque_nm
        rate_hz *= 0.5


def _is_straight(torque_nm: Array) -> bool:
    """Whether every second value lies between its neighbours, to a thousandth of the largest."""
    between = torque_nm[1:-1:2] - 0.5 * (torque_nm[:-2:2] + torque_nm[2::2])
    return float(np.max(np.abs(between))) <= STRAIGHT * _peak(torque_nm)


def _peak(x: Array) -> float:
    return float(np.max(np.abs(x))) if np.all(np.isfinite(x)) else math.inf


def has_no_restoring_spring(platform: Platform, rest_s: float) -> bool:
    """Whether there is no spring, or one too weak to bring the platform back within a rest."""
    j, c, k = platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad
    if k < 0.0 or c < 0.0:
        return False  # runs away by itself, which is said otherwise
    return k == 0.0 or 2.0 * math.pi * math.sqrt(j / k) > rest_s > 0.0 or c / k * SETTLED_TIME_CONSTANTS > rest_s > 0.0


class SetSequence:
    """All sets of a campaign one after the other, with a rest of free coasting between them."""

    def __init__(self, platform: Platform, sets: Sequence[PlannedSet], rest_s: float) -> None:
        self._forecasts = [SetForecast(platform, s) for s in sets]
        self._equations = Equations(platform)
        self._linear = not platform.effects
        count = max(2, math.ceil(rest_s * COAST_RATE_HZ) + 1)
        time_s: Array = np.arange(count) * (max(rest_s, 1e-3) / (count - 1))
        self._rest = Grid(time_s, None, self._equations.substeps(float(time_s[1])))

    def play(self, scales: Sequence[float]) -> list[SetMotion]:
        """Every set at its own amplitude."""
        state, found = AT_ORIGIN, []
        for forecast, scale in zip(self._forecasts, scales, strict=True):
            found.append(forecast.play(scale, state))
            state = self._coasted(found[-1].end)
        return found

    def _coasted(self, state: State) -> State:
        if not all(math.isfinite(x) for x in state):
            return state
        with np.errstate(all="ignore"):
            motion = self._rest.simulate(self._equations, state)
        return float(motion.angle_rad[-1]), float(motion.rate_rad_s[-1])

    def common_factor(self, scales: Sequence[float], allowed: Peaks) -> float:
        """The largest factor, at most 1, on all of these amplitudes with which the whole chain stays within limits."""
        found = [stretch.peaks for stretch in self.play(scales)]
        if all(peaks.within(allowed) for peaks in found):
            return 1.0
        if self._linear:
            return min(limit / value for peaks in found for value, limit in zip(peaks, allowed, strict=True) if value)
        return largest_factor(lambda factor: all(
            stretch.peaks.within(allowed) for stretch in self.play([factor * scale for scale in scales])
        ))  # fmt: skip


def largest_factor(passes: Callable[[float], bool]) -> float:
    """The largest factor below 1 that passes, found by bisection; 0 where none does."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(middle) else (low, middle)
    return low
