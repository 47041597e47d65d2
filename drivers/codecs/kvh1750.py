"""KVH 1750/1775 IMU: message formats A, B and C and the built-in-test replies.

Manual of the 1775 IMU, message formats; all big-endian. Whether the rotation fields are a rate or an angle
increment, in radians or degrees, is a setting of the device and must be told to the driver.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from drivers.codecs.checksums import crc32_mpeg2, sum8
from drivers.codecs.framing import BAD_CHECKSUM, NEED_MORE, NOT_A_HEAD

_HEAD = b"\xfe\x81"
_FORMATS = {
    b"\xfe\x81\xff\x55": ("A", 36),
    b"\xfe\x81\xff\x56": ("B", 40),
    b"\xfe\x81\xff\x57": ("C", 38),
    b"\xfe\x81\x00\xaa": ("BIT", 11),
    b"\xfe\x81\x00\xab": ("BIT2", 13),
}
_BODY = {"A": struct.Struct(">6fBBh"), "B": struct.Struct(">6fIBBh"), "C": struct.Struct(">6fBBf")}

SEQUENCE_MODULO = 128
STATUS_ALL_VALID = 0x77
"""Bits 0 to 2: rotation x, y, z valid; bits 4 to 6: acceleration x, y, z valid."""


@dataclass(frozen=True)
class KvhMessage:
    """One message. ``interleaved`` is format C's float: temperature or a magnetic axis, by sequence mod 4."""

    format: str
    rotation: tuple[float, float, float]
    acceleration_g: tuple[float, float, float]
    status: int
    sequence: int
    temperature_c: int | None = None
    timestamp_us: int | None = None
    interleaved: float | None = None


def match_kvh(buffer: bytes, position: int) -> int:
    """Matcher for the framer."""
    if buffer[position] != 0xFE:
        return NOT_A_HEAD
    head = buffer[position : position + 4]
    if len(head) < 4:
        return NEED_MORE if _HEAD.startswith(head[:2]) else NOT_A_HEAD
    found = _FORMATS.get(head)
    if found is None:
        return NOT_A_HEAD
    kind, length = found
    packet = buffer[position : position + length]
    if len(packet) < length:
        return NEED_MORE
    if kind.startswith("BIT"):
        return length if sum8(packet[:-1]) == packet[-1] else BAD_CHECKSUM
    return length if crc32_mpeg2(packet[:-4]) == int.from_bytes(packet[-4:], "big") else BAD_CHECKSUM


def decode_kvh(packet: bytes) -> KvhMessage | None:
    """Values of a packet as cut by the framer; None for a built-in-test reply."""
    kind = _FORMATS[packet[:4]][0]
    if kind.startswith("BIT"):
        return None
    rx, ry, rz, ax, ay, az, *rest = _BODY[kind].unpack(packet[4:-4])
    timestamp = rest.pop(0) if kind == "B" else None
    status, sequence, last = rest
    return KvhMessage(
        format=kind,
        rotation=(rx, ry, rz),
        acceleration_g=(ax, ay, az),
        status=status,
        sequence=sequence,
        temperature_c=None if kind == "C" else last,
        timestamp_us=timestamp,
        interleaved=last if kind == "C" else None,
    )


def encode_kvh(message: KvhMessage) -> bytes:
    """The packet as the device would send it."""
    head = next(head for head, (kind, _) in _FORMATS.items() if kind == message.format)
    values: list[float] = [*message.rotation, *message.acceleration_g]
    if message.format == "B":
        values.append(message.timestamp_us or 0)
    values += [message.status, message.sequence]
    values.append((message.interleaved or 0.0) if message.format == "C" else (message.temperature_c or 0))
    body = head + _BODY[message.format].pack(*values)
    return body + crc32_mpeg2(body).to_bytes(4, "big")


def built_in_test_passed(packet: bytes) -> bool:
    """True if every test bit of an extended BIT reply is set."""
    return all(byte & 0x7F == 0x7F for byte in packet[4:-1])
