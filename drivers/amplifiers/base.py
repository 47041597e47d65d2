"""The interface of every amplifier driver."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from drivers.bounded_log import FirstAndLast
from drivers.codecs.lawicel import CanFrame
from drivers.settings import Settings
from drivers.timing.retiming import ClockRetiming
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig
from rig.interface import TorqueSample

PROOF_FACTOR = 1.5  # of the watchdog, before the drive must have tripped


class Amplifier(ABC):
    """A servo amplifier on CAN that takes torque.

    Torques here are those at the shaft; the driver knows gear and sign. A sign of life for the drive's
    watchdog goes out in ``frames`` and in ``arm`` only, both of which run in the control loop: nothing
    here starts a thread or a periodic task, so a loop that hangs looks dead to the drive.
    """

    label = "amplifier"
    settings_model: type[Settings] | None = None  # of `bench.amplifier.settings`; None: not stated

    def __init__(self, config: AmplifierConfig) -> None:
        self.config = config
        self._reported: list[TorqueSample] = []
        self._to_motor = (-1.0 if config.invert else 1.0) / config.gear_ratio

    def motor_nm(self, shaft_nm: float) -> float:
        """Torque the motor has to make for this torque at the shaft."""
        return shaft_nm * self._to_motor

    def shaft_nm(self, motor_nm: float) -> float:
        """Torque at the shaft from this torque of the motor."""
        return motor_nm / self._to_motor

    @property
    @abstractmethod
    def peak_torque_nm(self) -> float | None:
        """The most that the drive gives at the shaft, once contacted; None where it does not say."""

    @property
    @abstractmethod
    def actual_torque_nm(self) -> float | None:
        """Torque at the shaft as the drive last reported it; None where it does not."""

    @property
    def readings(self) -> Mapping[str, float]:
        """What else the drive reports, by channel: ``drive_temperature_c``, ``drive_current_a`` (of the motor)."""
        return {}

    @property
    def stamps_torque(self) -> bool:
        """True if the drive reports its torque with the time of its own clock."""
        return False

    @property
    def emergencies(self) -> FirstAndLast[tuple[float, str]]:
        """What the drive reported of itself as gone wrong, each with the time at which it was heard."""
        return FirstAndLast()

    @property
    def retiming(self) -> ClockRetiming | None:
        """What is needed to stamp the reported torques anew; None where the drive has no clock."""
        return None

    def take_reported(self) -> list[TorqueSample]:
        """Torques at the shaft that the drive reported since the last call, with the best time known."""
        reported, self._reported = self._reported, []
        return reported

    @abstractmethod
    def contact(self, link: CanLink) -> list[str]:
        """Find the drive, set it up, no torque; notes for the operator. Raises DeviceFault."""

    def settle(self, link: CanLink) -> None:  # noqa: B027 (most drives need no time)
        """Called every few milliseconds between contact and arming, for what needs time; no torque."""

    @abstractmethod
    def arm(self, link: CanLink) -> None:
        """Enable at zero torque with the watchdog running. Raises DeviceFault."""

    @abstractmethod
    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """Everything to send in a tick that passed its checks: torque, and what feeds the watchdog."""

    @abstractmethod
    def sent_torque_nm(self, frame: CanFrame) -> float | None:
        """Torque at the shaft that a frame of ours commands, read back from its bytes; None if none."""

    def note_sent(self, time_s: float, frame: CanFrame) -> None:  # noqa: B027 (only clocks need it)
        """A frame of ours was handed over at this time; called for every one of them."""

    @abstractmethod
    def receive(self, heard: ReceivedFrame) -> None:
        """Take note of a frame from the bus."""

    @abstractmethod
    def check(self, now_s: float) -> None:
        """Raise DeviceFault if the drive has left operation, reported an emergency or fallen silent."""

    @abstractmethod
    def off_frames(self) -> Sequence[CanFrame]:
        """The shortest road to zero torque."""

    @abstractmethod
    def disarm(self, link: CanLink) -> None:
        """Zero torque, disable, and read back that it is off. Raises DeviceFault where it is not."""
