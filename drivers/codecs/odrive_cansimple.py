"""ODrive CANSimple: commands as data (after tools/odrive-cansimple.dbc of the firmware repository).

The 11-bit identifier is node << 5 | command; values are little-endian. Every frame addressed to an axis
feeds its watchdog.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple


class Command(IntEnum):
    """Message numbers of one axis."""

    HEARTBEAT = 0x01
    ESTOP = 0x02
    GET_MOTOR_ERROR = 0x03
    GET_ENCODER_ERROR = 0x04
    SET_AXIS_STATE = 0x07
    GET_ENCODER_ESTIMATES = 0x09
    SET_CONTROLLER_MODE = 0x0B
    SET_INPUT_TORQUE = 0x0E
    SET_LIMITS = 0x0F
    GET_IQ = 0x14
    GET_BUS_VOLTAGE_CURRENT = 0x17
    CLEAR_ERRORS = 0x18


AXIS_IDLE, AXIS_CLOSED_LOOP = 1, 8
CONTROL_TORQUE, INPUT_PASSTHROUGH = 1, 1
WATCHDOG_EXPIRED = 0x800
HEARTBEAT_S = 0.1  # as delivered (heartbeat_msg_rate_ms)

AXIS_STATES = {
    0: "undefined", 1: "idle", 2: "start-up sequence", 3: "full calibration", 4: "motor calibration",
    6: "encoder index search", 7: "encoder offset calibration", 8: "closed loop", 9: "lock-in spin",
    10: "encoder direction find", 11: "homing", 12: "hall polarity calibration", 13: "hall phase calibration",
}  # fmt: skip

AXIS_ERRORS = {
    0x1: "invalid state", 0x40: "motor failed", 0x80: "sensorless estimator failed", 0x100: "encoder failed",
    0x200: "controller failed", 0x800: "watchdog timer expired", 0x1000: "minimum end stop pressed",
    0x2000: "maximum end stop pressed", 0x4000: "emergency stop requested",
    0x20000: "homing without end stop", 0x40000: "over temperature", 0x80000: "position unknown",
}  # fmt: skip

_FORMATS = {
    Command.HEARTBEAT: struct.Struct("<IBBBB"),
    Command.ESTOP: struct.Struct("<"),
    Command.GET_MOTOR_ERROR: struct.Struct("<Q"),
    Command.GET_ENCODER_ERROR: struct.Struct("<I"),
    Command.SET_AXIS_STATE: struct.Struct("<I"),
    Command.GET_ENCODER_ESTIMATES: struct.Struct("<ff"),
    Command.SET_CONTROLLER_MODE: struct.Struct("<ii"),
    Command.SET_INPUT_TORQUE: struct.Struct("<f"),
    Command.SET_LIMITS: struct.Struct("<ff"),
    Command.GET_IQ: struct.Struct("<ff"),
    Command.GET_BUS_VOLTAGE_CURRENT: struct.Struct("<ff"),
    Command.CLEAR_ERRORS: struct.Struct("<"),
}


class Heartbeat(NamedTuple):
    """What an axis says of itself, ten times a second by default."""

    axis_error: int
    axis_state: int
    motor_error: int
    encoder_error: int
    controller_error: int


def identifier(node: int, command: Command) -> int:
    """CAN identifier of a command to (or from) a node."""
    return node << 5 | command


def split(can_id: int) -> tuple[int, int]:
    """(node, command number) of an identifier."""
    return can_id >> 5, can_id & 0x1F


def encode(command: Command, *values: float) -> bytes:
    """Payload of a command: ``encode(Command.SET_INPUT_TORQUE, 1.5)``."""
    return _FORMATS[command].pack(*values)


def decode(command: int, data: bytes) -> tuple[float, ...]:
    """Values of a payload (the length beyond what is known is ignored).

    Raises
    ------
    ValueError
        If the command is unknown or its payload too short.
    """
    try:
        form = _FORMATS[Command(command)]
        return tuple(form.unpack(data[: form.size]))
    except (ValueError, struct.error) as bad:
        raise ValueError(f"ODrive command 0x{command:02X} with payload {data.hex()!r}: {bad}") from None


def decode_heartbeat(data: bytes) -> Heartbeat:
    """The heartbeat; error words of newer firmware that differ in the upper bytes are ignored."""
    error, state, motor, encoder, controller = decode(Command.HEARTBEAT, data.ljust(8, b"\0"))
    return Heartbeat(int(error), int(state), int(motor), int(encoder), int(controller))


def errors_in_words(axis_error: int) -> str:
    """Axis error bits in words; "" when there is none."""
    words = [text for bit, text in AXIS_ERRORS.items() if axis_error & bit]
    rest = axis_error & ~sum(AXIS_ERRORS)
    return ", ".join([*words, *([f"unknown bits 0x{rest:X}"] if rest else [])])
