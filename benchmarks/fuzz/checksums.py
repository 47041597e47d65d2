"""The checksums of the wire once more, from their definitions and from nothing of the product.

One polynomial division a byte, most significant bit first; no zlib, no binascii. A fuzz run holds every packet that
the product accepts against these.
"""

from __future__ import annotations

from functools import lru_cache


@lru_cache
def _table(width: int, polynomial: int) -> tuple[int, ...]:
    top, mask = 1 << width - 1, (1 << width) - 1
    table = []
    for byte in range(256):
        value = byte << width - 8
        for _ in range(8):
            value = (value << 1 ^ polynomial) if value & top else value << 1
        table.append(value & mask)
    return tuple(table)


def remainder(data: bytes, width: int, polynomial: int, start: int) -> int:
    """Remainder of ``data`` by the polynomial, most significant bit first, nothing reflected."""
    table, mask, value = _table(width, polynomial), (1 << width) - 1, start
    for byte in data:
        value = (value << 8 & mask) ^ table[(value >> width - 8) ^ byte]
    return value


def stim300_crc(body: bytes) -> int:
    """CRC-32/MPEG-2 over the body and its dummy bytes (datasheet, 5.5.7)."""
    return remainder(body + bytes(-len(body) % 4), 32, 0x04C11DB7, 0xFFFFFFFF)


def kvh_crc(body: bytes) -> int:
    """CRC-32/MPEG-2, no dummy bytes."""
    return remainder(body, 32, 0x04C11DB7, 0xFFFFFFFF)


def utility_crc(body: bytes) -> int:
    """The STIM300's utility mode: polynomial 0x07, start 0xFF."""
    return remainder(body, 8, 0x07, 0xFF)


def vectornav_crc(body: bytes) -> int:
    """CRC-16, polynomial 0x1021, start 0."""
    return remainder(body, 16, 0x1021, 0)


def nmea_sum(body: bytes) -> int:
    """Exclusive or of all bytes."""
    value = 0
    for byte in body:
        value ^= byte
    return value


def byte_sum(body: bytes) -> int:
    """Sum modulo 256."""
    total = 0
    for byte in body:
        total = total + byte & 0xFF
    return total
