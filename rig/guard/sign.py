"""Reversed sign: whether the measured rate or the reversed one explains the torque.

A sign that turns in the middle of a set, well below resonance, leaves rate and travel within their limits, and the work
that it fakes is less than what an undeclared delay may fake. What it cannot fake is the platform: through one low-pass
for both, so that no start angle and no derivative of a noisy rate is needed,

    s M = J s^2 w + C s w + K w + F s sgn(w)

holds for J and K within a factor of those declared, C and F not negative, and a delay of the torque of up to 6 ms. Both
signs are fitted to the last moments. Where only the turned one explains the torque, the sign is wrong. Where the torque
changes faster than some 18 Hz nothing is said: a second mode turns signs there, and a delay half of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rig.arrays import Array
from rig.config.limits import LimitsConfig
from rig.guard.base import Check, Rest, Tick, TorqueHistory, Trip
from rig.platform import Platform

CORNER_RAD_S = 2.0 * math.pi * 20.0  # of each of the three stages: little of what a lag of the drive turns is left
DELAYS_S = (0.0, 0.003, 0.006)  # of the torque behind its command, of which any may be the true one
MAX_DECLARED_ERROR_RATIO = 2.5  # J and K may be wrong by so much: two, and what effects that nobody declared do to them
# Between two fits: 20 samples of 1 kHz share the cost of one. Not critical: tests/rig/guard holds from 5 to 50 ms.
FIT_EVERY_S = 0.02
# Fading memory of the fits. Longer sees a reversed sign later (0.5 s: no longer within a second), shorter holds less
# of a slow set from which to tell four coefficients apart. tests/rig/guard holds from 0.05 to 0.3 s.
MEMORY_S = 0.2
MAX_SAMPLE_SPACING_S = 0.006  # between samples: the filters are too coarse for slower gyros, which are not judged
FADES_S = 0.1  # of the filters: after so long nothing is left of where they began
SWEEPS = 6  # of the coordinate descent, which starts from the last fit
TURNED_LEAVES = 0.3  # of the torque, at most
LEAVES_MORE, TIMES_AS_MUCH = 0.2, 1.5  # what upright leaves at least, beside what turned round leaves
PASSED_SHARE = 0.3  # of the torque's change that the filters let through: beyond some 18 Hz a second mode turns signs
MIN_JUDGED_TORQUE_SHARE = 0.05  # of the most torque that there was in such moments of the set
# 80 ms of the same verdict, so that a single fit (an impact, a stick) is none; as much is added until a reversed sign
# is seen. Not critical: tests/rig/guard holds from 1 to 12.
BLOCKS_IN_A_ROW = 4
UPRIGHT, TURNED = 0, 1
WAYS = (1.0, -1.0)


class Fit:
    """Coefficients within their bounds by descent along one axis after the other, each time from where it ended."""

    def __init__(self, low: Sequence[float], high: Sequence[float]) -> None:
        self._low, self._high = low, high
        self._x = [min(1.0, most) if least > 0.0 else 0.0 for least, most in zip(low, high, strict=True)]

    def left(self, gram: Sequence[Sequence[float]], along: Sequence[float], whole: float) -> float:
        """The share of the sum of squares ``whole`` that the best coefficients leave."""
        x, count = self._x, len(self._x)
        for _ in range(SWEEPS):
            for i in range(count):
                row = gram[i]
                if row[i] <= 0.0:
                    continue
                step = along[i] - sum([row[k] * x[k] for k in range(count)])
                x[i] = min(max(x[i] + step / row[i], self._low[i]), self._high[i])
        square = sum([x[i] * (sum([gram[i][k] * x[k] for k in range(count)]) - 2.0 * along[i]) for i in range(count)])
        return max(0.0, (whole + square) / whole)


class ReversedSign(Check):
    """The torque of the last moments, by the platform as declared and by the same with the rate turned round."""

    def __init__(self, limits: LimitsConfig, platform: Platform) -> None:
        super().__init__(limits)
        self._inertia, self._stiffness = platform.inertia_kg_m2, max(0.0, platform.stiffness_nm_rad)

    def begin(self, start_s: float, rest: Rest) -> None:
        """From rest."""
        super().begin(start_s, rest)
        self._bias = rest.bias_rad_s
        self._still = 4.0 * rest.noise_rad_s
        self._past = TorqueHistory()
        self._last_s: float | None = None
        self._restart(start_s)
        low, high = (
            (1.0 / MAX_DECLARED_ERROR_RATIO, 0.0, 1.0 / MAX_DECLARED_ERROR_RATIO, 0.0),
            (MAX_DECLARED_ERROR_RATIO, math.inf, MAX_DECLARED_ERROR_RATIO, math.inf),
        )
        self._fits = [[Fit(low, high) for _ in DELAYS_S] for _ in WAYS]
        self._most = 0.0

    def _restart(self, time_s: float) -> None:
        """The filters know nothing of what was before."""
        self._begun_s = time_s
        self._stages = [0.0] * 9
        self._rows: list[tuple[float, ...]] = []
        self._torque: list[tuple[float, float, float]] = []  # a little longer than the block: it may act late
        self._block_s = time_s + FIT_EVERY_S
        self._gram: Array = np.zeros((4, 4))
        self._along: Array = np.zeros((len(DELAYS_S), 4))
        self._whole: Array = np.zeros(len(DELAYS_S))
        self._given = 0.0
        self._count = 0

    def look(self, tick: Tick) -> Trip | None:
        """Every valid sample with the torque of its time; a verdict every block."""
        self._past.add(tick.now_s, tick.torque_nm)
        for time_s, rate_rad_s, valid in tick.gyro:
            if not valid or (self._last_s is not None and time_s <= self._last_s):
                continue
            self._filter(time_s, rate_rad_s - self._bias)
            if time_s >= self._block_s and (trip := self._judge(time_s)) is not None:
                return trip
        return None

    def _filter(self, time_s: float, rate: float) -> None:
        """Three equal stages for rate, its direction and torque; differences of stages are derivatives."""
        nm = self._past.at(time_s)
        last_s, self._last_s = self._last_s, time_s
        if last_s is None or time_s - last_s > MAX_SAMPLE_SPACING_S:
            self._restart(time_s)
            return
        share = 1.0 - math.exp(-CORNER_RAD_S * (time_s - last_s))
        way = 0.0 if abs(rate) < self._still else math.copysign(1.0, rate)
        w1, w2, w3, s1, s2, s3, m1, m2, m3 = self._stages
        w1 += share * (rate - w1)
        w2 += share * (w1 - w2)
        w3 += share * (w2 - w3)
        s1 += share * (way - s1)
        s2 += share * (s1 - s2)
        s3 += share * (s2 - s3)
        m1 += share * (nm - m1)
        m2 += share * (m1 - m2)
        m3 += share * (m2 - m3)
        self._stages = [w1, w2, w3, s1, s2, s3, m1, m2, m3]
        self._rows.append((time_s, w1 - 2.0 * w2 + w3, w2 - w3, w3, s2 - s3))
        self._torque.append((time_s, m2 - m3, nm - m1))

    def _judge(self, time_s: float) -> Trip | None:
        self._block_s = time_s + FIT_EVERY_S
        if len(self._rows) < 2:
            return None
        self._remember(time_s)
        whole = float(self._whole[0])
        self._most = max(self._most, whole)
        least = max(MIN_JUDGED_TORQUE_SHARE * self._most, PASSED_SHARE * self._given)
        if time_s - self._begun_s < FADES_S or whole <= least:
            return None
        turned = self._left(TURNED)
        if turned > TURNED_LEAVES:  # as ever: nothing else needs to be asked
            self._count = 0
            return None
        upright, allowed = self._left(UPRIGHT), LEAVES_MORE + TIMES_AS_MUCH * turned
        self._count = self._count + 1 if upright > allowed else 0
        if self._count < BLOCKS_IN_A_ROW:
            return None
        return self._trip(
            "torque and rate have opposite signs: only the reversed rate explains the torque (limits.motion_check)",
            1e2 * upright, 1e2 * allowed, "% left unexplained", time_s,
            "Check the connectors, bench.amplifier.invert and bench.gyroscope.invert. If they are right, correct "
            "model.inertia_kg_m2 and model.stiffness_nm_rad.",
        )  # fmt: skip

    def _remember(self, time_s: float) -> None:
        """This block into the sums, of which the older ones fade."""
        rows, torque = np.array(self._rows), np.array(self._torque)
        times = rows[:, 0]
        x = rows[:, 1:] * (self._inertia * CORNER_RAD_S, 1.0, self._stiffness / CORNER_RAD_S, 1.0)
        fade = math.exp(-(float(times[-1]) - float(times[0])) / MEMORY_S)
        self._gram = fade * self._gram + x.T @ x
        for i, delay_s in enumerate(DELAYS_S):
            y = np.interp(times - delay_s, torque[:, 0], torque[:, 1])
            self._along[i] = fade * self._along[i] + x.T @ y
            self._whole[i] = fade * self._whole[i] + y @ y
        given = torque[-len(times) :, 2]
        self._given = fade * self._given + float(given @ given)
        self._rows.clear()
        kept_s = time_s - 2.0 * max(DELAYS_S)
        self._torque = [point for point in self._torque if point[0] >= kept_s]

    def _left(self, way: int) -> float:
        """The least that this way round leaves, whatever the delay."""
        gram, along = self._gram.tolist(), (WAYS[way] * self._along).tolist()
        cases = zip(self._fits[way], along, self._whole.tolist(), strict=True)
        return min([fit.left(gram, projected, whole) for fit, projected, whole in cases if whole > 0.0])
