"""Implausible motion: jumps, returned work and standstill that no torque explains, almost without the declared model.

What is declared may be wrong by a factor of two in inertia and stiffness, and may lack any friction, play or delay;
a lightly damped resonance is no fault. So nothing here compares with a predicted rate. Held on to is only what holds
for every platform that cannot make energy of its own: its rate does not step, the work done on it from rest is not
negative, and it does not stand still under any torque. What those leave open of the sign, ``rig.guard.sign`` decides.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from rig.config.limits import LimitsConfig
from rig.guard.base import Check, Rest, Tick, TorqueHistory, Trip
from rig.guard.sign import DELAYS_S, ReversedSign
from rig.platform import Platform

NOISE_SIGMAS = 8.0  # of a difference of samples: never by chance in a campaign of days
INERTIA_FACTOR = 3.0  # the declared inertia may be wrong by so much (decision 0016: two, and margin)
FRICTION_SHARE = 0.15  # of the torque limit: what friction may add or take away from one sample to the next
# Three ticks of 1 kHz: the bend spans two samples, and the torque may act one tick later. Longer hides jumps while the
# torque is fast. Not critical: tests/rig/guard holds from 1 to 20 ms, and none of its platforms trips falsely at 1 ms.
STEP_WINDOW_S = 0.003
STEP_BLOCK_S, STEP_BLOCKS = 0.01, 6  # steps are remembered for as long as a drive and a filter may take
# From the first to the third sample: 0.3 of a period of the paper's platform (29 Hz), in which its acceleration changes
# without any step. Gyros below 200 samples per second are not checked. tests/rig/guard holds from 3 to 100 ms.
MAX_THREE_SAMPLE_SPAN_S = 0.01
MIN_NOISE_RAD_S = 2e-3  # a tenth of a degree a second, where the rest before told nothing

REST_ENERGIES = 10.0  # a ring that is left over from before may give back what it has
ENERGY_CREDIT = 0.3  # of all work done in either direction: covers 20 degrees of phase beyond those
STORED_FACTOR = INERTIA_FACTOR  # of the energy stored by the declared model, which is proportional to J and K
# Of the most energy stored: what may be missing. Less trips falsely (0.2: one of forty random platforms), more misses a
# wrong sign within half a cycle (0.5: at 6 and 12 Hz); runs of tests/rig/guard, those marked slow included.
STORED_SHARE = 0.3
MIN_RATE_RAD_S = 0.5  # energies below that of so slow a motion are let be

MOVES_RAD_S, MOVES_MAX_RAD_S = math.radians(0.5), math.radians(3.0)  # however the rest before rang
MOVES_SHARE = 0.01  # of the largest rate of the set
STILL_FOR_S = 0.04  # beyond any delay between a torque and the sample that shows it
# By how much the torque may change at standstill: times the largest torque of the set so far, within shares of the
# torque limit. Friction F holds while the torque goes from -F to F, so 1.3 allows 0.65 of the set's torque as
# friction (decision 0016: two thirds). The least share lets small sets stick on friction of a tenth of the limit;
# tests/rig/guard holds from 0.05 to 0.4, at 0.02 a platform without a fault trips. The most bounds both; at 0.8 a
# gyro that came off its shaft is missed.
STILL_PEAKS, STILL_MIN, STILL_MAX = 1.3, 0.2, 0.4


class Jump(Check):
    """The rate from one sample to the next: torque bends it, nothing makes it step."""

    def __init__(self, limits: LimitsConfig, platform: Platform) -> None:
        super().__init__(limits)
        self._inertia, self._stiffness = platform.inertia_kg_m2, abs(platform.stiffness_nm_rad)
        self._recent: deque[tuple[float, float]] = deque()
        self._blocks: deque[float] = deque(maxlen=STEP_BLOCKS)
        self._block_end_s, self._block_nm, self._before_nm = -math.inf, 0.0, 0.0

    def begin(self, start_s: float, rest: Rest) -> None:
        """From the next two samples on."""
        super().begin(start_s, rest)
        self._noise = max(rest.noise_rad_s, MIN_NOISE_RAD_S)
        self._older: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None

    def _largest_step_nm(self, tick: Tick) -> float:
        """The largest change of the torque within about two ticks, over the last moments."""
        recent, now_s, nm = self._recent, tick.now_s, tick.torque_nm
        recent.append((now_s, nm))
        window_s = max(STEP_WINDOW_S, 1.5 * tick.period_s) + tick.late_s
        while len(recent) > 2 and recent[0][0] < now_s - window_s:
            recent.popleft()
        step_nm = 0.0
        for _, earlier_nm in recent:
            step_nm = max(step_nm, abs(nm - earlier_nm))
        if now_s >= self._block_end_s:
            self._blocks.append(self._block_nm)
            self._before_nm = max(self._blocks)
            self._block_end_s, self._block_nm = now_s + STEP_BLOCK_S, 0.0
        self._block_nm = max(self._block_nm, step_nm)
        return max(self._before_nm, self._block_nm)

    def look(self, tick: Tick) -> Trip | None:
        """Every valid sample with the two before it."""
        step_nm = self._largest_step_nm(tick)
        for time_s, rate, valid in tick.gyro:
            if not valid or (self._last is not None and time_s <= self._last[0]):
                continue
            trip = self._check_acceleration(time_s, rate, step_nm)
            self._older, self._last = self._last, (time_s, rate)
            if trip is not None:
                return trip
        return None

    def _check_acceleration(self, time_s: float, rate: float, step_nm: float) -> Trip | None:
        """The acceleration before and after the middle sample differ by what a change of torque makes, no more."""
        if self._older is None or self._last is None or time_s - self._older[0] > MAX_THREE_SAMPLE_SPAN_S:
            return None
        first_s, second_s = self._last[0] - self._older[0], time_s - self._last[0]
        before, after = (self._last[1] - self._older[1]) / first_s, (rate - self._last[1]) / second_s
        swing_nm = self._stiffness * max(abs(rate), abs(self._last[1])) * (first_s + second_s)
        torque_nm = step_nm + FRICTION_SHARE * self._limits.torque_nm + swing_nm
        noise = NOISE_SIGMAS * self._noise * (1.0 / first_s + 1.0 / second_s)
        unevenly = min(abs(before), abs(after))  # time stamps may be off by half their distance
        allowed = INERTIA_FACTOR * torque_nm / self._inertia + noise + unevenly
        if abs(after - before) <= allowed:
            return None
        jump, most = (math.degrees(x * second_s) for x in (abs(after - before), allowed))
        return self._trip(
            "implausible jump of the rate (limits.motion_check)", jump, most, "deg/s", time_s,
            "The torque cannot change the rate so fast: check the gyro, its cable and supply, and the end stops for "
            "an impact.",
        )  # fmt: skip


class Account:
    """Work done by a torque that acts so long after its command, and the most that it may have come down from."""

    def __init__(self, delay_s: float) -> None:
        self._delay_s = delay_s
        self._past = TorqueHistory()
        self._work = self._best = 0.0

    def command(self, time_s: float, torque_nm: float) -> None:
        """Commanded from this time on."""
        self._past.add(time_s + self._delay_s, torque_nm)

    def missing(self, time_s: float, turned_rad: float, stored: float) -> float:
        """Turned by so much until this time: the work that has come back and was never put in."""
        work = self._past.at(time_s) * turned_rad
        self._work += work + ENERGY_CREDIT * abs(work)
        self._best = max(self._best, self._work - STORED_FACTOR * stored)
        return self._best - self._work


class WrongSign(Check):
    """The work done on the platform: from rest it cannot give back what it never got."""

    def __init__(self, limits: LimitsConfig, platform: Platform) -> None:
        super().__init__(limits)
        self._inertia, self._stiffness = platform.inertia_kg_m2, abs(platform.stiffness_nm_rad)

    def begin(self, start_s: float, rest: Rest) -> None:
        """From rest."""
        super().begin(start_s, rest)
        self._bias = rest.bias_rad_s
        self._least = self._inertia * (0.5 * MIN_RATE_RAD_S**2 + REST_ENERGIES * rest.noise_rad_s**2)
        self._accounts = tuple(Account(delay_s) for delay_s in DELAYS_S)
        self._last: tuple[float, float] | None = None
        self._angle = self._stored_most = 0.0

    def look(self, tick: Tick) -> Trip | None:
        """Work since the moment at which least was stored for it."""
        for account in self._accounts:
            account.command(tick.now_s, tick.torque_nm)
        for time_s, rate_rad_s, valid in tick.gyro:
            if not valid:
                continue
            rate = rate_rad_s - self._bias
            if self._last is not None and time_s > self._last[0]:
                trip = self._balance(time_s, rate, 0.5 * (rate + self._last[1]) * (time_s - self._last[0]))
                if trip is not None:
                    return trip
            self._last = (time_s, rate)
        return None

    def _balance(self, time_s: float, rate: float, turned_rad: float) -> Trip | None:
        self._angle += turned_rad
        stored = 0.5 * (self._inertia * rate * rate + self._stiffness * self._angle * self._angle)
        self._stored_most = max(self._stored_most, stored)
        missing = min([account.missing(time_s, turned_rad, stored) for account in self._accounts])
        allowed = STORED_SHARE * self._stored_most + self._least
        if missing <= allowed:
            return None
        return self._trip(
            "torque and rate have opposite signs: the platform returned more work than was put in "
            "(limits.motion_check)",
            missing, allowed, "J", time_s,
            "Check bench.amplifier.invert and bench.gyroscope.invert, the coupling of gyro and motor to the shaft, and "
            "whether the declared inertia and stiffness are right to within a factor of two.",
        )  # fmt: skip


class Standstill(Check):
    """Torque that changes while nothing moves: a brake, a platform that is stuck, or a gyro that came off."""

    def __init__(self, limits: LimitsConfig, platform: Platform) -> None:
        super().__init__(limits)

    def begin(self, start_s: float, rest: Rest) -> None:
        """At rest, at zero torque."""
        super().begin(start_s, rest)
        self._bias = rest.bias_rad_s
        self._moves = min(max(NOISE_SIGMAS * rest.noise_rad_s, MOVES_RAD_S), MOVES_MAX_RAD_S)
        self._past = TorqueHistory()
        self._fastest = self._peak_nm = 0.0
        self._low = self._high = 0.0
        self._beyond_s: float | None = None

    def look(self, tick: Tick) -> Trip | None:
        """Every valid sample with the torque of its time."""
        self._past.add(tick.now_s, tick.torque_nm)
        for time_s, rate_rad_s, valid in tick.gyro:
            if valid and (trip := self._see(time_s, abs(rate_rad_s - self._bias))) is not None:
                return trip
        return None

    def _see(self, time_s: float, speed: float) -> Trip | None:
        nm = self._past.at(time_s)
        self._peak_nm = max(self._peak_nm, abs(nm))
        self._fastest = max(self._fastest, speed)
        if speed > max(self._moves, MOVES_SHARE * self._fastest):
            self._low = self._high = nm
            self._beyond_s = None
            return None
        self._low, self._high = min(self._low, nm), max(self._high, nm)
        allowed = self._allowed_nm()
        if self._high - self._low <= allowed:
            return None
        if self._beyond_s is None:
            self._beyond_s = time_s
        if time_s - self._beyond_s <= STILL_FOR_S:
            return None
        return self._trip(
            "torque changed while nothing moved (limits.standstill_torque_nm)", self._high - self._low, allowed, "N m",
            time_s, (
                "Check for an applied brake, a stuck platform, or a gyro that is loose on its shaft. If friction is "
                "really that large, raise the limit."
            ),
        )  # fmt: skip

    def _allowed_nm(self) -> float:
        given, most = self._limits.standstill_torque_nm, self._limits.torque_nm
        if given is not None:
            return given
        return max(STILL_MIN * most, min(STILL_MAX * most, STILL_PEAKS * self._peak_nm))


def motion_checks(limits: LimitsConfig, platform: Platform) -> Sequence[Check]:
    """All of them, or none where ``limits.motion_check`` is off or no inertia is declared."""
    if not limits.motion_check or platform.inertia_kg_m2 <= 0.0:
        return ()
    return tuple(check(limits, platform) for check in (Jump, WrongSign, ReversedSign, Standstill))
