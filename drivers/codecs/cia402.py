"""CiA 402 drive profile as data: statusword, controlword, modes, error codes (CiA 301 / 402)."""

from __future__ import annotations

from enum import Enum


class State(Enum):
    """States of the power drive system, in the words of the profile."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


_STATE_CODES = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.ENABLED),
    (0x6F, 0x07, State.QUICK_STOP),
    (0x4F, 0x0F, State.FAULT_REACTION),
    (0x4F, 0x08, State.FAULT),
)


def state_of(statusword: int) -> State | None:
    """The state that a statusword (0x6041) codes, or None for a combination the profile does not know."""
    return next((state for mask, code, state in _STATE_CODES if statusword & mask == code), None)


def statusword_of(state: State) -> int:
    """The bits of a statusword that code this state."""
    return next(code for _, code, known in _STATE_CODES if known is state)


SHUTDOWN, SWITCH_ON, ENABLE_OPERATION = 0x06, 0x07, 0x0F
DISABLE_VOLTAGE, QUICK_STOP, FAULT_RESET = 0x00, 0x02, 0x80

PATH_TO_ENABLED = {
    State.SWITCH_ON_DISABLED: SHUTDOWN,
    State.READY: SWITCH_ON,
    State.SWITCHED_ON: ENABLE_OPERATION,
    State.QUICK_STOP: DISABLE_VOLTAGE,
}
"""The controlword (0x6040) that leads one step nearer to "operation enabled"."""

PROFILE_TORQUE, CYCLIC_SYNCHRONOUS_TORQUE = 4, 10
MODE_BITS = {PROFILE_TORQUE: 1 << 3, CYCLIC_SYNCHRONOUS_TORQUE: 1 << 9}
"""Bit in 0x6502, supported drive modes."""
MODE_NAMES = {4: "profile torque", 10: "cyclic synchronous torque"}

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
ABORT_CONNECTION_OPTION, ERROR_CODE = 0x6007, 0x603F
MODE, MODE_DISPLAY, SUPPORTED_MODES = 0x6060, 0x6061, 0x6502
TARGET_TORQUE, MAX_TORQUE, RATED_TORQUE, ACTUAL_TORQUE = 0x6071, 0x6072, 0x6076, 0x6077
RATED_CURRENT, ACTUAL_CURRENT, TORQUE_SLOPE = 0x6075, 0x6078, 0x6087
HEARTBEAT_CONSUMER, HEARTBEAT_PRODUCER = 0x1016, 0x1017
TIME_STAMP = 0x1013  # microseconds of the device, 32 bit

_EMERGENCIES = {
    0x0000: "error reset or no error", 0x1000: "generic error",
    0x2310: "continuous over-current, device output",
    0x2320: "short circuit, device output", 0x2340: "short circuit, motor side", 0x3110: "mains over-voltage",
    0x3120: "mains under-voltage", 0x3210: "DC link over-voltage", 0x3220: "DC link under-voltage",
    0x4210: "over-temperature of the device", 0x4310: "over-temperature of the drive",
    0x5113: "logic supply too low", 0x5441: "parameter out of range", 0x6100: "internal software error",
    0x6320: "parameter error", 0x7121: "motor blocked", 0x7305: "incremental sensor 1 fault",
    0x7380: "position sensor fault", 0x8110: "CAN overrun (frames lost)", 0x8120: "CAN in error passive mode",
    0x8130: "heartbeat or life guard error: the drive no longer hears this computer",
    0x8140: "recovered from bus-off", 0x8150: "CAN identifier collision", 0x8210: "PDO too short",
    0x8220: "PDO too long", 0x8250: "RPDO timeout: set points stopped arriving", 0x8311: "excess torque",
    0x8400: "velocity control: speed limit", 0x8611: "following error", 0x8612: "reference limit",
    0xFF01: "maker-specific error 1",
}  # fmt: skip
_EMERGENCY_CLASSES = {
    0x10: "generic error", 0x20: "current", 0x21: "current, device input side",
    0x22: "current inside the device", 0x23: "current, device output side", 0x30: "voltage",
    0x31: "mains voltage", 0x32: "voltage inside the device",
    0x33: "output voltage", 0x40: "temperature", 0x41: "ambient temperature", 0x42: "device temperature",
    0x43: "drive temperature", 0x50: "device hardware", 0x60: "device software", 0x61: "internal software",
    0x62: "user software", 0x63: "data set", 0x70: "additional modules", 0x71: "power", 0x73: "sensor",
    0x80: "monitoring", 0x81: "communication", 0x82: "protocol error", 0x83: "torque control",
    0x84: "velocity control", 0x86: "position control", 0x90: "external error", 0xF0: "additional functions",
    0xFF: "maker-specific",
}  # fmt: skip


def emergency_in_words(code: int) -> str:
    """An EMCY error code as text: the known code, else its class."""
    exact = _EMERGENCIES.get(code)
    return exact or _EMERGENCY_CLASSES.get(code >> 8) or _EMERGENCY_CLASSES.get(code >> 8 & 0xF0, "unknown class")


def decode_emergency(data: bytes) -> tuple[int, int, bytes]:
    """(error code, error register, maker's five bytes) of an EMCY frame.

    Raises
    ------
    ValueError
        If the frame is shorter than three bytes.
    """
    if len(data) < 3:
        raise ValueError(f"EMCY frame of {len(data)} bytes, at least 3 expected: {data.hex()}")
    return int.from_bytes(data[:2], "little"), data[2], data[3:8]


def encode_emergency(code: int, register: int) -> bytes:
    """An EMCY frame without maker's data."""
    return code.to_bytes(2, "little") + bytes([register]) + bytes(5)
