"""mjbots moteus over CAN-FD: torque as feedforward of position mode with both gains scaled to zero.

Register protocol (docs/protocol/registers.md of the firmware). Its watchdog latches mode 11 ("position
timeout") a tenth of a second after the last command and holds it until a stop: that is the drive-side guard,
armed as delivered, and tested when the drive is armed here: with zero torque commanded, this computer falls silent once
and a controller that goes on as if nothing were is refused. Needs an adapter for CAN-FD with bit-rate switching
(``can.interface`` socketcan, ...).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from drivers.amplifiers.base import PROOF_FACTOR, Amplifier
from drivers.codecs.lawicel import CanFrame
from drivers.settings import Settings, read_settings
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault

MODE_STOPPED, MODE_FAULT, MODE_POSITION, MODE_TIMEOUT = 0, 1, 10, 11
ANSWER_TIMEOUT_S = 0.1  # s, far beyond a round trip on the bus; chosen, not derived
MAX_UNANSWERED_S = 0.05  # fifty ticks at 1 kHz without an answer

_WRITE_I8_1 = 0x01  # write one int8 register
_WRITE_F32_1, _WRITE_F32_2 = 0x0D, 0x0E
_READ_I8_3, _READ_F32_1 = 0x13, 0x1D
_REPLY_I8, _REPLY_F32 = 0x20, 0x2C
_NOP = 0x50  # fills a CAN-FD frame up to a length that exists
_MODE, _TORQUE, _VOLTAGE = 0x000, 0x003, 0x00D
_COMMAND_POSITION, _FEEDFORWARD, _KP_SCALE, _WATCHDOG = 0x020, 0x022, 0x023, 0x027
_FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_SIZES = {0: 1, 1: 2, 2: 4, 3: 4}
_SCALES = {0: 0.5, 1: 0.01, 2: 0.001, 3: 1.0}  # N m a bit: int8, int16, int32, float


def encode_torque(torque_nm: float, watchdog_s: float) -> bytes:
    """Position mode without gains: torque only; asks for mode, torque and fault in return."""
    body = bytes([_WRITE_I8_1, _MODE, MODE_POSITION])
    body += bytes([_WRITE_F32_2, _COMMAND_POSITION]) + struct.pack("<ff", float("nan"), 0.0)
    body += bytes([0x0C, 3, _FEEDFORWARD]) + struct.pack("<fff", torque_nm, 0.0, 0.0)
    body += bytes([_WRITE_F32_1, _WATCHDOG]) + struct.pack("<f", watchdog_s)
    return body + _QUERY


_QUERY = bytes([0x11, _MODE, _READ_F32_1, _TORQUE, 0x11, 0x0F])


def encode_stop() -> bytes:
    """Mode 0, and the same question."""
    return bytes([_WRITE_I8_1, _MODE, MODE_STOPPED]) + _QUERY


def padded(body: bytes) -> bytes:
    """Filled up with no-operations to a length that a CAN-FD frame can have."""
    length = next(n for n in _FD_LENGTHS if n >= len(body))
    return body.ljust(length, bytes([_NOP]))


def decode_registers(data: bytes) -> dict[int, float]:
    """Registers in a reply, torque scaled to N m, others as numbers.

    Raises
    ------
    ValueError
        If the reply is cut off or holds a subframe that is not known.
    """
    registers: dict[int, float] = {}
    at = 0
    while at < len(data):
        head = data[at]
        at += 1
        if head in (_NOP, 0x00):
            continue
        if not 0x20 <= head < 0x30:
            raise ValueError(f"moteus reply {data.hex()}: subframe 0x{head:02X} at {at - 1} is not known")
        kind, count = head >> 2 & 3, head & 3
        if at + 1 + (not count) > len(data):
            raise ValueError(f"moteus reply {data.hex()} is cut off")
        if not count:
            count, at = data[at], at + 1
        first, at = data[at], at + 1
        for k in range(count):
            raw = data[at : at + _SIZES[kind]]
            if len(raw) < _SIZES[kind]:
                raise ValueError(f"moteus reply {data.hex()} is cut off")
            at += _SIZES[kind]
            value = struct.unpack("<f", raw)[0] if kind == 3 else int.from_bytes(raw, "little", signed=True)
            registers[first + k] = value * _SCALES[kind] if first + k == _TORQUE else value
    return registers


class MoteusSettings(Settings):
    """What the controller does not report."""

    peak_torque_nm: Annotated[float, Field(gt=0)] = 1.0
    """Torque of the motor that its servo.max_current_A allows, N m."""
    host_id: Annotated[int, Field(ge=0, le=126)] = 0
    """This computer's address on the bus."""


class Moteus(Amplifier):
    """One controller."""

    settings_model = MoteusSettings

    def __init__(self, config: AmplifierConfig) -> None:
        super().__init__(config)
        self.settings = read_settings(MoteusSettings, config.settings, "bench.amplifier.settings")
        if config.can.interface == "slcan_bulk":
            raise ConfigError("bench.amplifier.can.interface: moteus needs CAN-FD, which slcan_bulk does not carry")
        self.label = f"moteus, id {config.node}"
        self._command_id = (0x80 | self.settings.host_id) << 8 | config.node
        self._reply_id = config.node << 8 | self.settings.host_id
        self._registers: dict[int, float] = {}
        self._heard_s: float | None = None
        self._armed = False

    def _frame(self, body: bytes) -> CanFrame:
        return CanFrame(self._command_id, padded(body), extended=True, fd=True)

    @property
    def peak_torque_nm(self) -> float | None:
        """As declared, at the shaft."""
        return abs(self.shaft_nm(self.settings.peak_torque_nm))

    @property
    def actual_torque_nm(self) -> float | None:
        """As reported, at the shaft."""
        torque = self._registers.get(_TORQUE)
        return None if torque is None else self.shaft_nm(torque)

    @property
    def mode(self) -> int | None:
        """Its mode register, once heard."""
        mode = self._registers.get(_MODE)
        return None if mode is None else int(mode)

    def _ask(self, link: CanLink, body: bytes) -> bool:
        asked_s = link.clock()
        link.send([self._frame(body)])
        return link.wait(ANSWER_TIMEOUT_S, lambda: (self._heard_s or 0.0) > asked_s)

    def contact(self, link: CanLink) -> list[str]:
        """Stop it and hear that it is there."""
        if self.receive not in link.listeners:
            link.listeners.append(self.receive)
        if not self._ask(link, encode_stop()):
            raise DeviceFault(f"{self.label} does not answer: check its supply, id and the CAN-FD bit rates (1/5 M)")
        return [
            f"peak {self.peak_torque_nm:.4g} N m as declared, watchdog {self.config.watchdog_ms} ms in each frame, "
            "tested when the drive is armed"
        ]

    def arm(self, link: CanLink) -> None:
        """Stop clears a latched timeout; then position mode at zero torque."""
        self._bring_to(link, encode_stop(), MODE_STOPPED)
        self._bring_to(link, encode_torque(0.0, self.config.watchdog_ms * 1e-3), MODE_POSITION)
        self._prove_watchdog(link)
        self._bring_to(link, encode_stop(), MODE_STOPPED)
        self._bring_to(link, encode_torque(0.0, self.config.watchdog_ms * 1e-3), MODE_POSITION)
        self._armed = True

    def _prove_watchdog(self, link: CanLink) -> None:
        """Silence for longer than the watchdog, then a question that commands nothing."""
        link.wait(PROOF_FACTOR * self.config.watchdog_ms * 1e-3, lambda: False)
        heard = self._ask(link, _QUERY)
        if not heard or self.mode != MODE_TIMEOUT:
            link.send(self.off_frames())
            raise DeviceFault(
                f"{self.label} keeps running although this computer stopped sending (mode {self.mode}, {MODE_TIMEOUT} "
                "expected). It is refused: use a firmware that supports the watchdog of the position command "
                "(register 0x027)."
            )

    def _bring_to(self, link: CanLink, body: bytes, mode: int) -> None:
        def again() -> None:
            link.send([self._frame(body)])

        again()
        if not link.wait(ANSWER_TIMEOUT_S, lambda: self.mode == mode, again):
            raise DeviceFault(f"{self.label} is in mode {self.mode} instead of {mode}: read its fault register")

    def frames(self, torque_nm: float, now_s: float) -> list[CanFrame]:
        """One frame commands, feeds the watchdog and asks."""
        peak = self.settings.peak_torque_nm
        motor_nm = max(-peak, min(peak, self.motor_nm(torque_nm)))
        return [self._frame(encode_torque(motor_nm, self.config.watchdog_ms * 1e-3))]

    def sent_torque_nm(self, frame: CanFrame) -> float | None:
        """From a frame of ours."""
        if frame.identifier != self._command_id or len(frame.data) < 28:
            return None
        return self.shaft_nm(struct.unpack_from("<f", frame.data, 16)[0])

    def receive(self, heard: ReceivedFrame) -> None:
        """A reply of this controller."""
        if heard.frame.identifier != self._reply_id or not heard.frame.extended:
            return
        try:
            self._registers = decode_registers(heard.frame.data)
        except ValueError:
            return  # a damaged reply counts as silence
        self._heard_s = heard.time_s

    def check(self, now_s: float) -> None:
        """Mode and silence."""
        if not self._armed:
            return
        if self.mode != MODE_POSITION:
            why = {
                MODE_TIMEOUT: "its watchdog expired: check the CAN cable and the load of this computer",
                MODE_FAULT: "it is in fault: read its fault register, remove the cause, then power-cycle it",
            }.get(self.mode or 0, "something else commands it: disconnect other hosts")
            raise DeviceFault(f"{self.label} left position mode (mode {self.mode}): {why}")
        if self._heard_s is not None and now_s - self._heard_s > MAX_UNANSWERED_S:
            raise DeviceFault(
                f"{self.label} is silent for {(now_s - self._heard_s) * 1e3:.0f} ms "
                f"(limit {MAX_UNANSWERED_S * 1e3:.0f} ms): check its supply and the CAN cable"
            )

    def off_frames(self) -> Sequence[CanFrame]:
        """Stop: the motor is free."""
        return [self._frame(encode_stop())]

    def disarm(self, link: CanLink) -> None:
        """Stop, and read the mode back."""
        self._armed = False
        if not self._ask(link, encode_stop()) or not link.wait(ANSWER_TIMEOUT_S, lambda: self.mode == MODE_STOPPED):
            raise DeviceFault(f"{self.label} does not confirm that it has stopped: PRESS THE EMERGENCY STOP")
