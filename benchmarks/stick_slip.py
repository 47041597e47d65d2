"""Stribeck friction by events: an integrator of its own, which shares nothing with the project's.

While the platform slides, J a = M(t) - C w - K th - s level(|w|) is smooth and goes through DOP853 with dense
output; sliding ends where the rate crosses zero. There it sticks if |M - K th| is at most the static level,
until the torque overcomes it (located by Brent's method), else it slides on in the direction of M - K th.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Array = NDArray[np.float64]
LOOK_S = 1e-4  # how finely a sticking platform's torque is looked at for breakaway
TOLERANCE = 1e-11


@dataclass(frozen=True)
class StickSlip:
    """A platform with the paper's friction (Eq. 7, its viscous term being C)."""

    inertia: float
    damping: float
    stiffness: float
    coulomb: float
    static: float
    speed: float

    def level(self, speed: float) -> float:
        """Friction torque at a speed, without its sign."""
        return self.coulomb + (self.static - self.coulomb) * math.exp(-((speed / self.speed) ** 2))

    def rate(self, torque: Callable[[float], float], time_s: Array) -> Array:
        """Rate at the instants ``time_s``, started from rest at the first of them."""
        out = np.zeros(len(time_s))
        t, end = float(time_s[0]), float(time_s[-1])
        angle = 0.0
        while t < end:
            push = torque(t) - self.stiffness * angle
            if abs(push) <= self.static:
                t = self._breakaway(torque, angle, t, end)
                if t >= end:
                    break
                push = torque(t + 1e-12) - self.stiffness * angle
            t, angle = self._slide(torque, math.copysign(1.0, push), angle, t, time_s, out)
        return out

    def _breakaway(self, torque: Callable[[float], float], angle: float, begin: float, end: float) -> float:
        def short(t: float) -> float:
            return abs(torque(t) - self.stiffness * angle) - self.static

        t = begin
        while t < end:
            later = min(t + LOOK_S, end)
            if short(later) > 0.0:
                return float(brentq(short, t, later, xtol=1e-15)) if short(t) < 0.0 else t
            t = later
        return end

    def _slide(
        self, torque: Callable[[float], float], sign: float, angle: float, begin: float, time_s: Array, out: Array
    ) -> tuple[float, float]:
        def slope(t: float, x: Array) -> list[float]:
            friction = sign * self.level(abs(x[1]))
            return [x[1], (torque(t) - self.damping * x[1] - self.stiffness * x[0] - friction) / self.inertia]

        def stopped(t: float, x: Array) -> float:
            return float(x[1])

        stopped.terminal, stopped.direction = True, -sign  # type: ignore[attr-defined]
        found = solve_ivp(
            slope, (begin, float(time_s[-1])), [angle, 0.0], "DOP853", dense_output=True, events=stopped,
            rtol=TOLERANCE, atol=1e-13, first_step=1e-6, max_step=2e-3,
        )  # fmt: skip
        until = float(found.t[-1])
        inside = (time_s > begin) & (time_s <= until)
        if np.any(inside):
            out[inside] = found.sol(time_s[inside])[1]
        return until, float(found.y[0, -1])
