"""The simulated rig: plant, gyroscope and amplifier behind the interface of a real one.

The plant's time is what the sequencer hands over, rounded to fine steps; nothing runs between the ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

from rig.channels import Channel
from rig.config.simulated import SimulatedConfig
from rig.errors import ConfigError, DeviceFault
from rig.interface import Exchange, GyroSample, Rig, Statement, Torque, TorqueOfTime, TorqueSample
from rig.signals import TorqueHold
from sim_backend import amplifier
from sim_backend.gyroscope import Gyroscope
from sim_backend.plant import SENSED_COLUMN, Plant

HIGHEST_COMMON_RATE_HZ = 100_000  # steps a second that are still simulated in seconds


class SimulatedRig(Rig):
    """A rig made of equations.

    Parameters
    ----------
    config
        The `simulated` section: the hidden truth and its devices.
    sample_rate_hz
        How often the sequencer ticks.
    seed
        Overrides the seed of the section.
    channels
        Measured channels that a model reads: nothing moves them here, they are reported at their reference.

    Raises
    ------
    ConfigError
        Where the gyro's rate and the sequencer's share no reasonable time grid.
    """

    def __init__(
        self, config: SimulatedConfig, sample_rate_hz: float, seed: int | None = None, channels: Iterable[Channel] = ()
    ) -> None:
        self._config = config
        self._held = {channel.name: channel.reference or 0.0 for channel in channels}
        common_hz = _common_rate_hz(sample_rate_hz, config.gyro.sample_rate_hz)
        self._common_hz = common_hz
        self._seed = config.seed if seed is None else seed
        self._is_open = False
        self._armed = False

    def statement(self) -> Statement:
        """Torque is SIMULATED."""
        kind = self._config.amplifier.kind
        held = [f"{name} held at {reading:g}, where its effects are zero" for name, reading in self._held.items()]
        devices = ("simulated platform", f"{kind} amplifier", "simulated gyroscope", *held)
        return Statement(Torque.SIMULATED, devices)

    @property
    def torque_hold(self) -> TorqueHold:
        """Smooth behind an ideal amplifier, else held."""
        return "band_limited" if self._config.amplifier.kind == "ideal" else "zero_order"

    @property
    def noise_rad_s(self) -> float | None:
        """White noise and rounding of the gyro's data sheet together."""
        gyro = self._config.gyro
        sigma = math.hypot(gyro.noise_deg_s, (gyro.resolution_deg_s or 0.0) / math.sqrt(12.0))
        return math.radians(sigma) or None

    @property
    def rate_full_scale_rad_s(self) -> float | None:
        """Full scale of the gyro."""
        full_scale = self._config.gyro.full_scale_deg_s
        return None if full_scale is None else math.radians(full_scale)

    @property
    def rate_full_scale_key(self) -> str:
        """Where it is declared."""
        return "simulated.gyro.full_scale_deg_s"

    def open(self) -> None:
        """Build the plant, at rest, and its devices."""
        config = self._config
        truth = config.platform.platform()
        rotor = amplifier.rotor_inertia_kg_m2(config.amplifier)
        if rotor:
            truth = replace(truth, inertia_kg_m2=truth.inertia_kg_m2 + rotor)
        self._plant = Plant(truth, 1.0 / self._common_hz)
        self._step_s = self._plant.step_s
        every = round(self._common_hz / config.gyro.sample_rate_hz) * self._plant.parts
        self._gyro = Gyroscope(config.gyro, self._step_s, every, self._seed)
        self._amplifier = amplifier.make(config.amplifier, self._step_s)
        self._epoch_s: float | None = None
        self._at = 0
        self._set = 0
        self._is_open = True

    def arm(self) -> None:
        """Accept torque."""
        if not self._is_open:
            raise DeviceFault("the simulated rig is armed before it is open: open it first")
        self._armed = True

    def _instant(self, now_s: float) -> int:
        if self._epoch_s is None:
            self._epoch_s = now_s
        return round((now_s - self._epoch_s) / self._step_s)

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """Advance the plant to this instant under the last command, then take the new one."""
        if not self._armed:
            raise DeviceFault("torque was sent to a simulated rig that is not armed: arm it first")
        n = self._instant(now_s) - self._at
        gyro: list[GyroSample] = []
        torque: list[TorqueSample] = []
        if n > 0:
            rows, torque = self._amplifier.advance(self._plant, self._at, n)
            gyro = self._gyro.sense(rows[:, SENSED_COLUMN], self._at, n, (self._at + n) * self._step_s)
            self._at += n
        torque += self._amplifier.command(torque_nm, self._at)
        epoch = self._epoch_s
        if epoch:
            gyro = [GyroSample(t + epoch, rate, valid) for t, rate, valid in gyro]
            torque = [TorqueSample(t + epoch, value) for t, value in torque]
        return Exchange(gyro, torque, self._held)

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:
        """An own noise stream for the set, and the excitation for an ideal amplifier."""
        self._set += 1
        self._gyro.restart(self._set)
        self._amplifier.begin_set(torque, self._instant(start_s))

    def end_set(self) -> None:
        """The rests draw on a noise stream of their own."""
        self._gyro.restart(0)
        self._amplifier.end_set()

    def torque_off(self) -> None:
        """Zero torque from the present instant on."""
        if self._is_open:
            self._amplifier.end_set()
            self._amplifier.command(0.0, self._at)

    def disarm(self) -> None:
        """Zero torque and no more commands."""
        self.torque_off()
        self._armed = False

    def close(self) -> None:
        """Forget the plant."""
        self._armed = self._is_open = False


def _common_rate_hz(tick_hz: float, gyro_hz: float) -> float:
    """The lowest rate that is a whole multiple of both."""
    a, b = Fraction(tick_hz).limit_denominator(1000), Fraction(gyro_hz).limit_denominator(1000)
    common = Fraction(math.lcm(a.numerator * b.denominator, b.numerator * a.denominator)) / (
        a.denominator * b.denominator
    )
    if common > HIGHEST_COMMON_RATE_HZ:
        raise ConfigError(
            f"simulated.gyro.sample_rate_hz = {gyro_hz:g} and excitation.sample_rate_hz = {tick_hz:g} have no common "
            f"multiple up to {HIGHEST_COMMON_RATE_HZ} Hz: choose rates of which one is a multiple of the other"
        )
    return float(common)
