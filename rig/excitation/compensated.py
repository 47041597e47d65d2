"""A set with a compensating torque on top, which a model gave as a table over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.excitation.base import ExcitationSet
from rig.excitation.planned import PlannedSet

TICK_OFFSETS = np.array([0, -1, 1, -2, 2])  # ticks, the likeliest first
ON_TIME = 1e-3  # of a tick: rounding of its instant


@dataclass(frozen=True)
class TorqueTable:
    """A torque at even steps from the start of a run, straight in between, zero before and behind.

    Parameters
    ----------
    step_s
        Between two values.
    torque_nm
        Shape (n,).
    """

    step_s: float
    torque_nm: Array

    def at(self, time_s: Any) -> Any:
        """Torque in N m at seconds since the start of the run; a float or an array of any shape."""
        if isinstance(time_s, float):
            return self._at_once(time_s)
        place = np.asarray(time_s, dtype=float) / self.step_s
        last = len(self.torque_nm) - 1
        first = np.clip(place.astype(np.int64), 0, last - 1)
        share = place - first
        between = self.torque_nm[first] + share * (self.torque_nm[first + 1] - self.torque_nm[first])
        return between * ((place >= 0.0) & (place <= last))

    def _at_once(self, time_s: float) -> float:
        """The same of one instant, which a tick waits for: 1 us in place of 30."""
        place, last = time_s / self.step_s, len(self._values) - 1
        if not 0.0 <= place <= last:
            return 0.0
        first = min(int(place), last - 1)
        here = self._values[first]
        return here + (place - first) * (self._values[first + 1] - here)

    @cached_property
    def _values(self) -> list[float]:
        return list(self.torque_nm.tolist())


@dataclass(frozen=True)
class HeldCommands:
    """A torque for every tick from the start of a run, held until the next one; zero before and behind.

    Parameters
    ----------
    tick_s
        Between two commands.
    torque_nm
        Shape (n,).
    """

    tick_s: float
    torque_nm: Array

    def at(self, time_s: Any) -> Any:
        """Torque in N m at seconds since the start of the run; a float or an array of any shape."""
        if isinstance(time_s, float):  # one instant, which a tick waits for: 1 us in place of 25
            one = math.floor(time_s / self.tick_s + ON_TIME)
            return self._values[one] if 0 <= one < len(self._values) else 0.0
        tick = np.floor(np.asarray(time_s, dtype=float) / self.tick_s + ON_TIME).astype(np.int64)
        inside = (tick >= 0) & (tick < len(self.torque_nm))
        return self.torque_nm[np.clip(tick, 0, len(self.torque_nm) - 1)] * inside

    @cached_property
    def _values(self) -> list[float]:
        return list(self.torque_nm.tolist())

    def asked_at(self, time_s: Array, recorded_nm: Array) -> Array:
        """The tick of the command behind each recorded torque, in s, (n,): of those around it the one of that value.

        A late tick sends the command of its instant, and a drive stamps what it applied by its own clock.
        """
        nearest = np.rint(time_s / self.tick_s).astype(np.int64)
        around = np.clip(nearest[:, None] + TICK_OFFSETS, 0, len(self.torque_nm) - 1)
        off = np.abs(self.torque_nm[around] - recorded_nm[:, None])
        ticks: Array = np.take_along_axis(around, np.argmin(off, axis=1)[:, None], axis=1)[:, 0] * self.tick_s
        return ticks


class CompensatedSet(ExcitationSet):
    """A set as planned, begun ``lead_s`` after its run does, and a compensating torque over the whole run.

    No rig.yaml declares one: what compensates a set comes from an identified model.
    """

    plain: Any
    """The set without compensation, a PlannedSet."""
    lead_s: float
    """By how much later than the run the set begins, s: a delay of the drive asks for torque before it is wanted."""
    compensation: Any
    """The further torque, a TorqueTable from the start of the run."""
    early_s: float = 0.0
    """By how much later than it is recorded a torque reaches the shaft, s."""
    latency_s: float = 0.0
    """By how much later than it is asked for a torque is recorded, s."""
    commands: Any = None
    """The whole torque as held commands, where a drive rounds what it is asked for; or None."""

    @property
    def sine_hz(self) -> float | None:
        """The frequency of the set without compensation, where that is a single sine."""
        planned: PlannedSet = self.plain
        return planned.frequency_hz

    def describe(self) -> str:
        """ "0.5 Hz, compensated"."""
        return f"{self.plain.name}, compensated"

    def shape(self, time_s: Any) -> Any:
        """Torque in N m."""
        if self.commands is not None:
            return self.commands.at(time_s)
        return self.plain.torque(time_s - self.lead_s) + self.compensation.at(time_s)

    def asked(self, time_s: Array, recorded_nm: Array) -> tuple[Array, Array, Array]:
        """What was asked for behind a recorded torque, (n,) each.

        Returns
        -------
        at_shaft_s
            When it reaches the shaft, since the start of the run.
        set_nm
            The set alone then.
        exact_nm
            The whole torque before the drive rounds it: what is recorded beyond it, rounding moved and late ticks
            played otherwise.
        """
        asked_s = time_s - self.latency_s
        at_shaft_s = time_s + self.early_s
        if self.commands is not None:
            asked_s = self.commands.asked_at(asked_s, recorded_nm)
            set_nm = self.plain.torque(asked_s + self.latency_s + self.early_s - self.lead_s)
        else:
            set_nm = self.plain.torque(at_shaft_s - self.lead_s)
        return at_shaft_s, set_nm, self.plain.torque(asked_s - self.lead_s) + self.compensation.at(asked_s)

    @classmethod
    def of(
        cls, plain: PlannedSet, name: str, lead_s: float, compensation: TorqueTable, early_s: float = 0.0,
        latency_s: float = 0.0, commands: HeldCommands | None = None,
    ) -> PlannedSet:  # fmt: skip
        """The planned set of that name that plays ``plain`` with its compensation."""
        made = cls(
            name=name, duration_s=plain.duration_s + lead_s, use=plain.use, plain=plain, lead_s=lead_s,
            compensation=compensation, early_s=early_s, latency_s=latency_s, commands=commands,
        )  # fmt: skip
        return PlannedSet(made.title, made)
