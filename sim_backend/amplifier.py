"""Amplifier models between the commanded torque and the shaft of the simulated platform, one class each.

An amplifier advances the plant under the torque it makes and reports that torque: instantaneous samples
of a smooth torque where it is ideal, values that held from their time stamp on where it is not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from rig.arrays import Array
from rig.config.simulated import AnyAmplifier, HoldAmplifier, IdealAmplifier, MotorAmplifier
from rig.interface import TorqueOfTime, TorqueSample
from rig.signals import TorqueHold
from sim_backend.motor import motor_state

if TYPE_CHECKING:
    from sim_backend.plant import Plant

MIN_QUARTER_STEPS = 1 << 15  # quarter steps of an excitation that are evaluated at a time


class Amplifier(ABC):
    """Makes torque of commands. Instants are counted in fine steps of the plant."""

    hold: TorqueHold = "zero_order"

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._command_nm = 0.0

    @abstractmethod
    def advance(self, plant: Plant, first: int, n: int) -> tuple[Array, list[TorqueSample]]:
        """Advance the plant from instant ``first`` by n fine steps under the present command.

        Returns the plant's rows and the torque reported for the stretch.
        """

    def command(self, torque_nm: float, at: int) -> list[TorqueSample]:
        """Take a new command at instant ``at``; returns what can be reported of it at once."""
        self._command_nm = torque_nm
        return []

    def begin_set(self, torque: TorqueOfTime, at: int) -> None:  # noqa: B027 (only the ideal one looks ahead)
        """The excitation that the commands to come are taken from, as a function of seconds since ``at``."""

    def end_set(self) -> None:  # noqa: B027
        """The excitation is over."""


class Ideal(Amplifier):
    """Follows the excitation itself between the ticks, as long as the commands agree with it."""

    hold: TorqueHold = "band_limited"

    def __init__(self, step_s: float) -> None:
        super().__init__(step_s)
        self._torque: TorqueOfTime | None = None
        self._start = 0
        self._following = False
        self._block_first = 0
        self._block: Array = np.empty(0)

    def begin_set(self, torque: TorqueOfTime, at: int) -> None:
        """Follow this excitation from instant ``at`` on."""
        self._torque, self._start = torque, at
        self._block = np.empty(0)

    def end_set(self) -> None:
        """Back to plain commands."""
        self._torque, self._following = None, False

    def _quarter_steps(self, first: int, n: int) -> Array:
        """Torque at the 4 n quarter steps that follow instant ``first``."""
        at = 4 * (first - self._start) + 1  # counted in quarter steps since the start of the set
        if not self._block_first <= at <= at + 4 * n <= self._block_first + len(self._block):
            assert self._torque is not None
            count = np.arange(at, at + max(MIN_QUARTER_STEPS, 4 * n))
            self._block = np.asarray(self._torque(0.25 * self._step_s * count), dtype=np.float64)
            self._block_first = at
        skip = at - self._block_first
        return self._block[skip : skip + 4 * n]

    def advance(self, plant: Plant, first: int, n: int) -> tuple[Array, list[TorqueSample]]:
        """Along the excitation, or held where a command has left it."""
        if not self._following:
            return plant.hold(self._command_nm, n), []
        rows = plant.follow(self._quarter_steps(first, n))
        return rows, [TorqueSample((first + n) * self._step_s, float(rows[n - 1, 3]))]

    def command(self, torque_nm: float, at: int) -> list[TorqueSample]:
        """Follow the excitation if this is its value, else hold the command."""
        was_following, self._following = self._following, False
        if self._torque is not None:
            expected = float(self._torque((at - self._start) * self._step_s))
            self._following = abs(torque_nm - expected) <= 1e-9 * max(1.0, abs(expected))
        super().command(torque_nm, at)
        return [] if was_following else [TorqueSample(at * self._step_s, torque_nm)]


class Hold(Amplifier):
    """Rounds each command to the drive's resolution and holds it until the next."""

    def __init__(self, config: HoldAmplifier, step_s: float) -> None:
        super().__init__(step_s)
        self._resolution_nm = config.resolution_nm

    def advance(self, plant: Plant, first: int, n: int) -> tuple[Array, list[TorqueSample]]:
        """Under the held command; it was reported when it came."""
        return plant.hold(self._command_nm, n), []

    def command(self, torque_nm: float, at: int) -> list[TorqueSample]:
        """Round and hold."""
        super().command(rounded(torque_nm, self._resolution_nm), at)
        return [TorqueSample(at * self._step_s, self._command_nm)]


class Motor(Amplifier):
    """A motor with its electrics; reports the mean torque of every fine step from the current it drew."""

    def __init__(self, config: MotorAmplifier, step_s: float) -> None:
        super().__init__(step_s)
        self._motor = motor_state(config)
        self._resolution_nm = config.resolution_nm

    def advance(self, plant: Plant, first: int, n: int) -> tuple[Array, list[TorqueSample]]:
        """Behind the electrics."""
        rows = plant.drive(self._command_nm, n, self._motor)
        step = self._step_s
        return rows, [TorqueSample((first + i) * step, x) for i, x in enumerate(rows[:n, 3].tolist())]

    def command(self, torque_nm: float, at: int) -> list[TorqueSample]:
        """Round and pass on as the current reference."""
        return super().command(rounded(torque_nm, self._resolution_nm), at)


def rounded(torque_nm: float, resolution_nm: float | None) -> float:
    """To the nearest multiple of the resolution."""
    return resolution_nm * round(torque_nm / resolution_nm) if resolution_nm else torque_nm


def make(config: AnyAmplifier, step_s: float) -> Amplifier:
    """The amplifier of a configuration."""
    if isinstance(config, IdealAmplifier):
        return Ideal(step_s)
    return Hold(config, step_s) if isinstance(config, HoldAmplifier) else Motor(config, step_s)


def rotor_inertia_kg_m2(config: AnyAmplifier) -> float:
    """What the rotor adds at the shaft: J_m N^2 (Eq. 6: J = J_m + J_L)."""
    if isinstance(config, MotorAmplifier):
        return config.rotor_inertia_kg_m2 * config.gear_ratio**2
    return 0.0
