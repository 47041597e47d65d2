"""The interface of the guard: what it sees of a tick, a trip, and a single check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rig.config.limits import LimitsConfig
from rig.interface import GyroSample, TorqueSample


@dataclass(frozen=True)
class Trip:
    """A broken limit: which, by how much, when (seconds since the start of the set) and what to do."""

    limit: str
    value: float
    allowed: float
    unit: str
    time_s: float
    what_to_do: str

    def __str__(self) -> str:
        return (
            f"{self.limit}: {self.value:.4g} {self.unit} at {self.time_s:.3f} s, allowed is {self.allowed:.4g} "
            f"{self.unit}. {self.what_to_do}"
        )


class Rest(NamedTuple):
    """What the gyro read at rest before a set: its bias, how sure that is, and the noise of one sample."""

    bias_rad_s: float = 0.0
    bias_sigma_rad_s: float = 0.0
    noise_rad_s: float = 0.0


class Tick(NamedTuple):
    """One tick as the guard sees it; times on the sequencer's clock."""

    now_s: float
    late_s: float
    period_s: float
    torque_nm: float
    gyro: Sequence[GyroSample]
    torque: Sequence[TorqueSample]
    channels: Mapping[str, float]


class TorqueHistory:
    """What was commanded, by time: a gyro's samples are milliseconds older than the tick that brings them."""

    def __init__(self) -> None:
        self._steps: deque[tuple[float, float]] = deque()
        self._nm = 0.0

    def add(self, time_s: float, torque_nm: float) -> None:
        """Commanded from ``time_s`` on."""
        self._steps.append((time_s, torque_nm))

    def at(self, time_s: float) -> float:
        """The torque at ``time_s``; calls come in the order of time."""
        steps = self._steps
        while steps and steps[0][0] <= time_s:
            self._nm = steps.popleft()[1]
        return self._nm


class Check(ABC):
    """One limit. ``start_s`` is the instant that times of trips count from."""

    def __init__(self, limits: LimitsConfig) -> None:
        self._limits = limits
        self._start_s = 0.0

    def origin(self) -> None:  # noqa: B027 (most checks remember nothing from one set to the next)
        """A campaign begins, from rest: what counts from its beginning counts from here."""

    def begin(self, start_s: float, rest: Rest) -> None:
        """A set begins, from rest."""
        self._start_s = start_s

    @abstractmethod
    def look(self, tick: Tick) -> Trip | None:
        """The verdict on one tick."""

    def _trip(self, limit: str, value: float, allowed: float, unit: str, time_s: float, what_to_do: str) -> Trip:
        return Trip(limit, value, allowed, unit, time_s - self._start_s, what_to_do)
