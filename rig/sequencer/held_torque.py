"""Ticks that came late: the drive held its torque meanwhile, which strikes the platform like a pulse."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from rig.platform import Platform

MAX_PULSES = 256  # remembered: a loop that is late more often than that rings from the last of them


class Pulse(NamedTuple):
    """A late tick: how long ago and by how much (s), and the impulse of the torque held too long (N m s)."""

    age_s: float
    late_s: float
    impulse_nm_s: float

    def added_rate_rad_s(self, platform: Platform) -> float:
        """How fast the platform may still be from it, in rad/s: impulse / J, decaying with 2 J / C on a spring."""
        j, c = platform.inertia_kg_m2, max(0.0, platform.damping_nm_s_rad)
        decay_1_s = c / (2.0 * j) if platform.stiffness_nm_rad > 0.0 else c / j
        return self.impulse_nm_s / j * math.exp(-decay_1_s * self.age_s)

    def added_travel_rad(self, platform: Platform) -> float:
        """How far the platform may be off from it, in rad: rate over natural frequency; without a spring, coasting."""
        j, c, k = platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad
        if k > 0.0:
            return self.added_rate_rad_s(platform) / math.sqrt(k / j)
        coasted_s = self.age_s if c <= 0.0 else -j / c * math.expm1(-c / j * self.age_s)
        return self.impulse_nm_s / j * coasted_s


class HeldTorque:
    """Collects what late ticks did, the newest ``MAX_PULSES`` of them."""

    def __init__(self) -> None:
        self._pulses: deque[tuple[float, float, float]] = deque(maxlen=MAX_PULSES)
        self._torque_nm = 0.0

    def take(self, now_s: float, late_s: float, period_s: float, torque_nm: float) -> None:
        """A tick is about to send ``torque_nm``; by less than a period late it holds no torque too long."""
        if late_s > period_s:
            self._pulses.append((now_s, late_s, 0.5 * abs(torque_nm - self._torque_nm) * late_s))
        self._torque_nm = torque_nm

    def pulses(self, now_s: float) -> list[Pulse]:
        """As they are seen from ``now_s``, in the order of time."""
        return [Pulse(max(0.0, now_s - time_s), late_s, nm_s) for time_s, late_s, nm_s in self._pulses]
