"""The properties of a rig that follow from its gyroscope and its drive, live or replayed from a capture."""

from __future__ import annotations

from drivers.bench.retiming import BenchRetiming
from drivers.gyroscopes.base import Gyroscope
from rig.interface import Correction, ExpectedDelay, LowPass, Rig
from rig.signals import TorqueHold


class DeviceRig(Rig):
    """A rig whose sensor and torque are those of drivers."""

    gyroscope: Gyroscope
    _retiming: BenchRetiming

    @property
    def torque_hold(self) -> TorqueHold:
        """A set point is held until the next."""
        return "zero_order"

    @property
    def noise_rad_s(self) -> float | None:
        """As the gyro's data sheet has it."""
        return self.gyroscope.noise_rad_s

    @property
    def rate_low_pass(self) -> LowPass | None:
        """Of the gyroscope."""
        return self.gyroscope.low_pass

    @property
    def expected_delay(self) -> ExpectedDelay:
        """Of both roads, as far as the drivers know them."""
        return self._retiming.expected_delay()

    @property
    def rate_full_scale_rad_s(self) -> float | None:
        """Of the gyroscope."""
        return self.gyroscope.full_scale_rad_s

    @property
    def rate_full_scale_key(self) -> str:
        """The device decides, by its data sheet."""
        return "bench.gyroscope.device"

    def corrections(self) -> tuple[Correction, ...]:
        """Times that are known better now that all is played."""
        return self._retiming.corrections()
