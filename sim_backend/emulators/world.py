"""The platform in real time: torque that changes at any instant, rate at the instants of the gyro."""

from __future__ import annotations

import sys
from collections import deque

from rig.platform import Platform
from sim_backend.plant import SENSED_COLUMN, Plant

QUIET_MARGIN = 1e-6  # steps: a change within so much of a grid point is left to the single step before that


class World:
    """A plant on a fixed grid of host time, driven by a torque that is held between changes.

    A change within a step counts by its share of the step, and what that puts too early is taken over into the next
    one: impulse and its moment are exact wherever on the grid the change falls. Impulse alone would act like a torque
    that was smoothed over a step.

    Parameters
    ----------
    platform
        The truth, with the effects that nobody declared.
    start_s
        Host time of the first grid point; the platform is at rest there.
    step_s
        Grid spacing in seconds of host time.
    """

    def __init__(self, platform: Platform, start_s: float, step_s: float) -> None:
        self._plant = Plant(platform, step_s)
        self._parts = self._plant.parts
        self._start_s = start_s
        self._step_s = step_s
        self._at = 0
        self._torque_nm = self._taken_over_nm = 0.0
        self._changes: deque[tuple[float, float]] = deque()
        self._plant.hold(0.0, self._parts)  # compiles, or loads what was compiled, before time counts

    def change_torque(self, time_s: float, torque_nm: float) -> None:
        """The torque from ``time_s`` on; calls come in the order of their times."""
        self._changes.append((time_s, torque_nm))

    def advance(self, steps: int) -> list[float]:
        """Advance by so many grid steps; the rates behind the sensor effects at their ends, in rad/s."""
        rates: list[float] = []
        while len(rates) < steps:
            quiet = min(self._quiet_steps(), steps - len(rates))
            rates += self._hold(self._torque_nm, quiet) if quiet else self._hold(self._mean_torque_nm(), 1)
        return rates

    def _quiet_steps(self) -> int:
        """Whole steps from here on in which the torque does not change."""
        if self._taken_over_nm:
            return 0
        if not self._changes:
            return sys.maxsize
        return max(0, int((self._changes[0][0] - self._start_s) / self._step_s - QUIET_MARGIN) - self._at)

    def _mean_torque_nm(self) -> float:
        """Mean over the coming step, changes within it by their share; the torque at its end is kept."""
        begin_s = self._start_s + self._at * self._step_s
        end_s = begin_s + self._step_s
        mean_nm = self._torque_nm + self._taken_over_nm
        self._taken_over_nm = 0.0
        while self._changes and self._changes[0][0] < end_s:
            time_s, torque_nm = self._changes.popleft()
            share = (end_s - max(time_s, begin_s)) / self._step_s
            mean_nm += (torque_nm - self._torque_nm) * share
            self._taken_over_nm += (torque_nm - self._torque_nm) * 0.5 * share * (1.0 - share)
            self._torque_nm = torque_nm
        return mean_nm - self._taken_over_nm

    def _hold(self, torque_nm: float, steps: int) -> list[float]:
        rows = self._plant.hold(torque_nm, steps * self._parts)
        self._at += steps
        rates: list[float] = rows[self._parts - 1 : steps * self._parts : self._parts, SENSED_COLUMN].tolist()
        return rates
