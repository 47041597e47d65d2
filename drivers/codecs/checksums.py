"""Checksums that the devices use, each in the form that is fast in plain Python."""

from __future__ import annotations

import binascii
import zlib
from functools import reduce
from operator import xor

_BIT_REVERSED = bytes(int(f"{value:08b}"[::-1], 2) for value in range(256))


def crc32_mpeg2(data: bytes) -> int:
    """CRC-32/MPEG-2: polynomial 0x04C11DB7, seed 0xFFFFFFFF, MSB first, nothing reflected, no final xor.

    ``zlib.crc32`` is the reflected sibling; bit-reversing bytes on the way in and the word on the way out
    gives this one in 0.5 us instead of the 4 us of a table in Python.
    """
    reflected = zlib.crc32(data.translate(_BIT_REVERSED)) ^ 0xFFFFFFFF
    return int.from_bytes(reflected.to_bytes(4, "little").translate(_BIT_REVERSED), "big")


def _crc8_table(polynomial: int) -> bytes:
    table = bytearray()
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = ((value << 1) ^ polynomial if value & 0x80 else value << 1) & 0xFF
        table.append(value)
    return bytes(table)


_CRC8_07 = _crc8_table(0x07)


def crc8_07(data: bytes, seed: int = 0xFF) -> int:
    """CRC-8, polynomial 0x07, seed 0xFF, as the STIM300's utility mode uses it."""
    value = seed
    for byte in data:
        value = _CRC8_07[value ^ byte]
    return value


def crc16_xmodem(data: bytes) -> int:
    """CRC-16/XMODEM (polynomial 0x1021, seed 0), as VectorNav uses it."""
    return binascii.crc_hqx(data, 0)


def xor8(data: bytes) -> int:
    """Exclusive or of all bytes (NMEA style)."""
    return reduce(xor, data, 0)


def sum8(data: bytes) -> int:
    """Sum of all bytes modulo 256."""
    return sum(data) & 0xFF
