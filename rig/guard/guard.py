"""The guard: checks every limit before and after the exchange of each tick, and trips.

A pure state machine: no clock, no device. Each limit is one small check, so that a new one is a class and
a line in ``CHECKS``. The first broken limit is the verdict; taking the torque off is the sequencer's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rig.config.limits import LimitsConfig
from rig.guard.base import Check, Rest, Tick, Trip
from rig.guard.readings import READINGS

__all__ = ["CHECKS", "Check", "Guard", "Rest", "Tick", "Trip"]

BOUND_SIGMAS = 3.0  # of the drift of an integrated rate that counts as travel
MEASURED_TORQUE_EXCESS = 1.05  # a drive's own torque reading may overshoot the limit by so much


class MissedTicks(Check):
    """Ticks in a row whose deadline was missed by a whole period."""

    def __init__(self, limits: LimitsConfig) -> None:
        super().__init__(limits)
        self._in_a_row = 0

    def begin(self, start_s: float, rest: Rest) -> None:
        """Count from zero."""
        super().begin(start_s, rest)
        self._in_a_row = 0

    def look(self, tick: Tick) -> Trip | None:
        """Count this tick's missed periods."""
        missed = int(tick.late_s / tick.period_s + 1e-9)
        self._in_a_row = self._in_a_row + missed if missed else 0
        if self._in_a_row <= self._limits.missed_ticks:
            return None
        return self._trip(
            "missed ticks in a row (limits.missed_ticks)", self._in_a_row, self._limits.missed_ticks, "ticks",
            tick.now_s, "This computer is too slow: lower excitation.sample_rate_hz, or stop other programs.",
        )  # fmt: skip


class StaleGyro(Check):
    """No valid sample for too long; a machine that was late meanwhile is a likelier cause than a cable."""

    def begin(self, start_s: float, rest: Rest) -> None:
        """The set begins with a fresh gyro."""
        super().begin(start_s, rest)
        self._last_s = start_s
        self._late_s = 0.0

    def look(self, tick: Tick) -> Trip | None:
        """Age of the newest valid sample."""
        self._late_s = max(self._late_s, tick.late_s)
        for time_s, _, valid in tick.gyro:
            if valid and time_s > self._last_s:
                self._last_s, self._late_s = time_s, tick.late_s
        age_ms = (tick.now_s - self._last_s) * 1e3
        if age_ms <= self._limits.stale_gyro_ms + tick.period_s * 1e3:
            return None
        return self._trip(
            "gyro stale (limits.stale_gyro_ms)", age_ms, self._limits.stale_gyro_ms, "ms", tick.now_s,
            self._advice(tick.period_s),
        )  # fmt: skip

    def _advice(self, period_s: float) -> str:
        if self._late_s <= period_s:
            return (
                "No valid gyro sample arrived: check the cable and supply, and whether the rate exceeded the full "
                "scale."
            )
        return (
            f"This computer is too slow: it was {self._late_s * 1e3:.1f} ms late since the last valid sample. Stop "
            "other programs; if it happens again without delays, check the gyro's cable and supply."
        )


class FrozenGyro(Check):
    """Bit-identical samples for too long: a sensor that hangs goes on reporting its last value."""

    def begin(self, start_s: float, rest: Rest) -> None:
        """Nothing seen yet."""
        super().begin(start_s, rest)
        self._value = math.nan
        self._since_s = start_s

    def look(self, tick: Tick) -> Trip | None:
        """How long the value has not changed."""
        allowed_ms = self._limits.frozen_gyro_ms
        if allowed_ms is None:
            return None
        for time_s, rate, _ in tick.gyro:
            if rate != self._value:
                self._value, self._since_s = rate, time_s
            elif (time_s - self._since_s) * 1e3 > allowed_ms:
                return self._trip(
                    "gyro frozen (limits.frozen_gyro_ms)", (time_s - self._since_s) * 1e3, allowed_ms,
                    "ms without a change", time_s,
                    "Restart the gyro. A simulated gyro without noise needs limits.frozen_gyro_ms: null.",
                )  # fmt: skip
        return None


class Rate(Check):
    """The measured rate, a clipped sample counting with its full-scale value."""

    def look(self, tick: Tick) -> Trip | None:
        """Every sample of this tick."""
        allowed = self._limits.rate_deg_s
        for time_s, rate, valid in tick.gyro:
            rate_deg_s = abs(math.degrees(rate))
            if rate_deg_s > allowed or (not valid and rate_deg_s >= allowed * (1.0 - 1e-9)):
                return self._trip(
                    "rate (limits.rate_deg_s)", rate_deg_s, allowed, "deg/s", time_s,
                    "Lower torque_nm; `rig check` gives the largest allowed.",
                )  # fmt: skip
        return None


class Travel(Check):
    """Angle from where the campaign began: the rate less its resting bias, integrated, plus what it may have drifted.

    A platform without a spring stays where a set leaves it, so nothing is forgotten between sets. The bias is learnt
    anew at each rest. What came since the last one is corrected as if the bias had gone straight from one value to the
    other; a change beyond the noise of both may also be a platform that coasts, and counts as doubt in full.
    """

    def __init__(self, limits: LimitsConfig) -> None:
        super().__init__(limits)
        self.origin()

    def origin(self) -> None:
        """Angle zero; the bias is learnt at the next beginning."""
        self._rest: Rest | None = None
        self._angle_rad = self._doubt_rad = self._variance = 0.0
        self._last: tuple[float, float] | None = None

    def begin(self, start_s: float, rest: Rest) -> None:
        """From where it stands, at rest."""
        old, since_s = self._rest, start_s - self._start_s
        super().begin(start_s, rest)
        self._rest = rest
        if old is None:
            self._angle_rad, self._last = 0.0, None
            return
        change = rest.bias_rad_s - old.bias_rad_s
        sigma = math.hypot(rest.bias_sigma_rad_s, old.bias_sigma_rad_s)
        self._angle_rad -= 0.5 * change * since_s
        self._doubt_rad += 0.5 * max(0.0, abs(change) - BOUND_SIGMAS * sigma) * since_s
        self._variance += (0.5 * sigma * since_s) ** 2

    def look(self, tick: Tick) -> Trip | None:
        """Integrate this tick's valid samples (trapezoids, across gaps too) and compare."""
        for time_s, rate_rad_s, valid in tick.gyro:
            if not valid:
                continue
            last, self._last = self._last, (time_s, rate_rad_s)
            if last is not None and time_s > last[0]:
                trip = self._turned(time_s, 0.5 * (rate_rad_s + last[1]), time_s - last[0])
                if trip is not None:
                    return trip
        return None

    def _turned(self, time_s: float, rate_rad_s: float, step_s: float) -> Trip | None:
        rest = self._rest or Rest()
        self._angle_rad += (rate_rad_s - rest.bias_rad_s) * step_s
        elapsed_s = time_s - self._start_s
        drift = rest.bias_sigma_rad_s * elapsed_s
        walk = rest.noise_rad_s * math.sqrt(max(0.0, step_s * elapsed_s))
        sigma = math.sqrt(self._variance + drift * drift + walk * walk)
        bound_deg = math.degrees(BOUND_SIGMAS * sigma + self._doubt_rad)
        travel_deg = abs(math.degrees(self._angle_rad)) + bound_deg
        if travel_deg <= self._limits.travel_deg:
            return None
        return self._trip(
            f"travel (limits.travel_deg; {bound_deg:.2g} deg of it is possible drift of the gyro)",
            travel_deg, self._limits.travel_deg, "deg", time_s,
            "Lower torque_nm or excitation.margin; the declared model may be too stiff. Travel is measured from the "
            "start of the campaign: without a spring, each set starts where the previous one ended. If the gyro drift "
            "is large, the platform may not have come to rest: lengthen excitation.rest_s.",
        )  # fmt: skip


class MeasuredTorque(Check):
    """What the drive says it applied."""

    def look(self, tick: Tick) -> Trip | None:
        """Every torque sample of this tick."""
        allowed = self._limits.torque_nm
        for time_s, torque_nm in tick.torque:
            if not abs(torque_nm) <= allowed * MEASURED_TORQUE_EXCESS:
                more_percent = 100.0 * (MEASURED_TORQUE_EXCESS - 1.0)
                return self._trip(
                    f"applied torque (limits.torque_nm, and {more_percent:.0f} % more)", abs(torque_nm),
                    allowed * MEASURED_TORQUE_EXCESS, "N m", time_s,
                    "The drive applied more torque than commanded: check the torque constant, the rated torque and "
                    "the gear under bench.amplifier.",
                )  # fmt: skip
        return None


CHECKS: tuple[type[Check], ...] = (MissedTicks, StaleGyro, FrozenGyro, Rate, Travel, MeasuredTorque, *READINGS)


class Guard:
    """All checks of one campaign.

    Parameters
    ----------
    limits
        The `limits` section.
    checks
        Further checks beside ``CHECKS``, for what only some rigs report.
    """

    def __init__(self, limits: LimitsConfig, checks: Sequence[Check] = ()) -> None:
        self._torque_nm = limits.torque_nm
        self._stall_s = limits.stall_ms / 1e3
        self._checks = (*(check(limits) for check in CHECKS), *checks)
        self._start_s = 0.0
        self.begin(0.0, Rest())
        self.origin()

    def origin(self) -> None:
        """The campaign begins: travel counts from where the platform stands now, whatever is played from here on."""
        for check in self._checks:
            check.origin()

    def begin(self, start_s: float, rest: Rest) -> None:
        """A set, or a rest, begins at ``start_s`` from standstill."""
        self._start_s = start_s
        for check in self._checks:
            check.begin(start_s, rest)

    def permit(self, torque_nm: float, now_s: float, late_s: float) -> Trip | None:
        """The verdict on a torque before it is sent: nothing is sent after a stall, nor beyond the limit.

        A stall is a tick that comes far too late: a stopped process, a device that blocked, a clock that
        jumped. A torque that is not a number is never permitted.
        """
        if late_s > self._stall_s:
            return Trip(
                "stall or clock jump (limits.stall_ms)", late_s * 1e3, self._stall_s * 1e3, "ms late",
                now_s - self._start_s,
                "The campaign does not resume after a stall. Find the cause (system load, standby, clock "
                "adjustment), then start again.",
            )  # fmt: skip
        if abs(torque_nm) <= self._torque_nm:
            return None
        return Trip(
            "torque (limits.torque_nm)", abs(torque_nm), self._torque_nm, "N m", now_s - self._start_s,
            "It was not sent. Lower torque_nm of this set.",
        )  # fmt: skip

    def look(self, tick: Tick) -> Trip | None:
        """The first broken limit of a tick, or None."""
        for check in self._checks:
            trip = check.look(tick)
            if trip is not None:
                return trip
        return None
