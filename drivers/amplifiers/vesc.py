"""VESC over CAN: motor current in mA; the torque constant has to be declared.

Frames have 29-bit identifiers command << 8 | id and big-endian payloads (vedderb/bldc, comm_can). Its own
timeout (1000 ms as delivered, app settings) is the drive-side watchdog: set it in VESC Tool to what
``watchdog_ms`` says; CAN cannot read it, so ``timeout_is_set`` has to confirm it.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field

from drivers.amplifiers.base import Amplifier
from drivers.codecs.lawicel import CanFrame
from drivers.settings import Settings, read_settings
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault

SET_CURRENT, STATUS, STATUS_4 = 1, 9, 16
STATUS_TIMEOUT_S = 0.5  # s, chosen, not derived
MAX_STATUS_SPACING_S = 0.25  # s without a status message; chosen, not derived
ZERO_CURRENT_A = 0.5  # A; what counts as zero; chosen, not derived


def encode_current(current_a: float) -> bytes:
    """Payload of SET_CURRENT."""
    return struct.pack(">i", round(current_a * 1000.0))


def decode_status(data: bytes) -> tuple[float, float, float]:
    """(electrical rpm, motor current in A, duty cycle) of a STATUS frame.

    Raises
    ------
    ValueError
        If the payload is not eight bytes long.
    """
    if len(data) != 8:
        raise ValueError(f"VESC status of {len(data)} bytes, 8 expected: {data.hex()}")
    erpm, current, duty = struct.unpack(">ihh", data)
    return float(erpm), current / 10.0, duty / 1000.0


def decode_temperatures(data: bytes) -> tuple[float, float]:
    """(controller, motor) in deg C of a STATUS 4 frame.

    Raises
    ------
    ValueError
        If the payload is not eight bytes long.
    """
    if len(data) != 8:
        raise ValueError(f"VESC status 4 of {len(data)} bytes, 8 expected: {data.hex()}")
    controller, motor = struct.unpack_from(">hh", data)
    return controller / 10.0, motor / 10.0


class VescSettings(Settings):
    """What the controller does not report."""

    torque_constant_nm_a: Annotated[float, Field(gt=0)]
    """Torque per current of the motor, N m/A."""
    peak_current_a: Annotated[float, Field(gt=0)]
    """Largest current of the controller, A."""
    timeout_is_set: bool = False
    """true once the timeout in VESC Tool (App Settings) equals watchdog_ms."""


class Vesc(Amplifier):
    """One controller."""

    settings_model = VescSettings

    def __init__(self, config: AmplifierConfig) -> None:
        super().__init__(config)
        self.settings = read_settings(VescSettings, config.settings, "bench.amplifier.settings")
        if not self.settings.timeout_is_set:
            raise ConfigError(
                f"bench.amplifier.settings.timeout_is_set: set the VESC's timeout to {config.watchdog_ms} ms in VESC "
                "Tool (App Settings), then set this key to true; without it the motor keeps running for a second "
                "after this computer fails"
            )
        self.label = f"VESC, id {config.node}"
        self._current_id = SET_CURRENT << 8 | config.node
        self._status_id = STATUS << 8 | config.node
        self._temperatures_id = STATUS_4 << 8 | config.node
        self._hottest_c: float | None = None
        self._current_a: float | None = None
        self._heard_s: float | None = None
        self._armed = False

    @property
    def peak_torque_nm(self) -> float | None:
        """From declared current and constant, at the shaft."""
        return abs(self.shaft_nm(self.settings.peak_current_a * self.settings.torque_constant_nm_a))

    @property
    def actual_torque_nm(self) -> float | None:
        """From the reported current, at the shaft."""
        if self._current_a is None:
            return None
        return self.shaft_nm(self._current_a * self.settings.torque_constant_nm_a)

    @property
    def readings(self) -> Mapping[str, float]:
        """Motor current; the hotter of controller and motor where status 4 is switched on."""
        known = {"drive_current_a": self._current_a, "drive_temperature_c": self._hottest_c}
        return {name: value for name, value in known.items() if value is not None}

    def _command(self, current_a: float) -> CanFrame:
        return CanFrame(self._current_id, encode_current(current_a), extended=True)

    def contact(self, link: CanLink) -> list[str]:
        """Hear its status frames."""
        if self.receive not in link.listeners:
            link.listeners.append(self.receive)
        if not link.wait(STATUS_TIMEOUT_S, lambda: self._heard_s is not None):
            raise DeviceFault(
                f"{self.label} sends no status: switch on CAN status 1 in VESC Tool, check id and bit rate"
            )
        return [f"peak {self.peak_torque_nm:.4g} N m as declared, time-out set in VESC Tool"]

    def arm(self, link: CanLink) -> None:
        """There is no enable: zero current from now on."""
        link.send([self._command(0.0)])
        self._armed = True

    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """The current, which feeds the time-out."""
        s = self.settings
        current_a = self.motor_nm(torque_nm) / s.torque_constant_nm_a
        return [self._command(max(-s.peak_current_a, min(s.peak_current_a, current_a)))]

    def sent_torque_nm(self, frame: CanFrame) -> float | None:
        """From a current frame of ours."""
        if frame.identifier != self._current_id:
            return None
        milliamperes: int = struct.unpack(">i", frame.data)[0]
        return self.shaft_nm(milliamperes * 1e-3 * self.settings.torque_constant_nm_a)

    def receive(self, heard: ReceivedFrame) -> None:
        """Status frames."""
        frame = heard.frame
        if not frame.extended or len(frame.data) != 8:
            return
        if frame.identifier == self._status_id:
            self._heard_s = heard.time_s
            self._current_a = decode_status(frame.data)[1]
        elif frame.identifier == self._temperatures_id:
            self._hottest_c = max(decode_temperatures(frame.data))

    def check(self, now_s: float) -> None:
        """Silence; a VESC reports no faults on CAN."""
        if self._armed and self._heard_s is not None and now_s - self._heard_s > MAX_STATUS_SPACING_S:
            raise DeviceFault(
                f"{self.label} is silent for {(now_s - self._heard_s) * 1e3:.0f} ms "
                f"(limit {MAX_STATUS_SPACING_S * 1e3:.0f} ms): check its supply and the CAN cable"
            )

    def off_frames(self) -> Sequence[CanFrame]:
        """Zero current."""
        return [self._command(0.0)]

    def disarm(self, link: CanLink) -> None:
        """Zero current, and the current seen to be gone."""
        self._armed = False
        link.send(self.off_frames(), urgent=True)
        asked_s = link.clock()
        off = link.wait(
            STATUS_TIMEOUT_S,
            lambda: (self._heard_s or 0.0) > asked_s and abs(self._current_a or 0.0) < ZERO_CURRENT_A,
        )
        if not off:
            raise DeviceFault(f"{self.label} does not report zero current: PRESS THE EMERGENCY STOP")
