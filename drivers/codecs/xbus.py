"""Xsens Xbus (MTi): enough to read the rate of turn from MTData2 and to step over everything else.

FA FF | message id | length (FF: two more bytes) | data | checksum: all after FA sum to 0 modulo 256
"""

from __future__ import annotations

import struct

from drivers.codecs.checksums import sum8
from drivers.codecs.framing import BAD_CHECKSUM, NEED_MORE, NOT_A_HEAD, TOO_LONG

MTDATA2 = 0x36
RATE_OF_TURN = 0x8020
_LONGEST = 2048


def _extent(buffer: bytes, position: int) -> tuple[int, int]:
    """(start of data, whole length) of the message, or (NEED_MORE, reason)."""
    if len(buffer) < position + 4:
        return 0, NEED_MORE
    length, start = buffer[position + 3], position + 4
    if length == 0xFF:
        if len(buffer) < position + 6:
            return 0, NEED_MORE
        length, start = int.from_bytes(buffer[position + 4 : position + 6], "big"), position + 6
    return start, TOO_LONG if length > _LONGEST else start - position + length + 1


def match_xbus(buffer: bytes, position: int) -> int:
    """Matcher for the framer."""
    if buffer[position] != 0xFA or buffer[position + 1 : position + 2] not in (b"", b"\xff"):
        return NOT_A_HEAD
    start, length = _extent(buffer, position)
    if start == 0 or length == TOO_LONG:
        return length
    packet = buffer[position : position + length]
    if len(packet) < length:
        return NEED_MORE
    return length if sum8(packet[1:]) == 0 else BAD_CHECKSUM


def _fp1220(data: bytes) -> tuple[float, ...]:
    return tuple(int.from_bytes(data[k : k + 4], "big", signed=True) * 2.0**-20 for k in (0, 4, 8))


def _fp1632(data: bytes) -> tuple[float, ...]:
    # The 32 fraction bits come first, the 16 integer bits after them.
    words = (data[k + 4 : k + 6] + data[k : k + 4] for k in (0, 6, 12))
    return tuple(int.from_bytes(word, "big", signed=True) * 2.0**-32 for word in words)


_PRECISION = {
    0: (12, lambda data: struct.unpack(">3f", data)),
    1: (12, _fp1220),
    2: (18, _fp1632),
    3: (24, lambda data: struct.unpack(">3d", data)),
}


def rate_of_turn(packet: bytes) -> tuple[float, float, float] | None:
    """Rate of the three axes in rad/s from an MTData2 packet, or None if it holds no rate of turn."""
    start, length = _extent(packet, 0)
    if length <= 0 or packet[2] != MTDATA2:
        return None
    at, end = start, length - 1
    while at + 3 <= end:
        identifier, size = int.from_bytes(packet[at : at + 2], "big"), packet[at + 2]
        data = packet[at + 3 : at + 3 + size]
        wanted, read = _PRECISION[identifier & 3]
        if identifier & 0xFFF0 == RATE_OF_TURN and len(data) == wanted == size:
            x, y, z = read(data)
            return x, y, z
        at += 3 + size
    return None
