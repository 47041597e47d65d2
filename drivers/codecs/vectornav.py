"""VectorNav VN-100/200: ASCII messages and binary output.

    $VNYMR,...*68 CR LF     8-bit: exclusive or of what stands between $ and *
    $VNRRG,06,1,1*0865      16-bit: CRC-16/XMODEM of the same
    FA | groups | one u16 of fields a group | payload, little-endian | CRC-16 big-endian over all after FA

Field sizes after the maker's SDK; rates are rad/s.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from drivers.codecs.checksums import crc16_xmodem, xor8
from drivers.codecs.framing import BAD_CHECKSUM, NEED_MORE, NOT_A_HEAD, TOO_LONG

_MAX_MESSAGE_BYTES = 256
_HEX = frozenset(b"0123456789ABCDEFabcdef")
_LONGEST_BINARY = 600

# Sizes in bytes of the fields of each group, by bit; 0 marks a reserved bit.
_SIZES: dict[int, tuple[int, ...]] = {
    0: (8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8),  # common
    1: (8, 8, 8, 2, 8, 8, 8, 4, 4, 1),  # time
    2: (2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2),  # inertial
    4: (2, 12, 16, 36, 12, 12, 12, 12, 12),  # attitude
}
TIME_STARTUP, YAW_PITCH_ROLL, ANGULAR_RATE = (0, 0), (0, 3), (0, 5)
IMU_ANGULAR_RATE = (2, 10)

_RATE_COLUMNS = {"YMR": 9, "GYR": 0, "IMU": 6, "QMR": 10, "MAR": 6}
"""Where the three rates begin in the ASCII message of that name."""

ERRORS = {
    1: "hard fault",
    2: "serial buffer overflow",
    3: "invalid checksum",
    4: "invalid command",
    5: "not enough parameters",
    6: "too many parameters",
    7: "invalid parameter",
    8: "invalid register",
    9: "unauthorized access",
    10: "watchdog reset",
    11: "output buffer overflow",
    12: "insufficient baud rate for this output",
    255: "error buffer overflow",
}


def match_vectornav(buffer: bytes, position: int) -> int:
    """Matcher for the framer: ASCII lines and binary packets in one stream."""
    head = buffer[position]
    if head == 0x24:
        return _match_line(buffer, position)
    if head == 0xFA:
        return _match_binary(buffer, position)
    return NOT_A_HEAD


def _match_line(buffer: bytes, position: int) -> int:
    if buffer[position : position + 3] not in (b"$", b"$V", b"$VN"):
        return NOT_A_HEAD
    end = buffer.find(b"\n", position, position + _MAX_MESSAGE_BYTES)
    if end < 0:
        return NEED_MORE if len(buffer) - position < _MAX_MESSAGE_BYTES else TOO_LONG
    line = buffer[position : end + 1]
    return len(line) if line_checksum_is_right(line) else BAD_CHECKSUM


def line_checksum_is_right(line: bytes) -> bool:
    """True if the text between $ and * matches the two or four hexadecimal digits behind it."""
    body, star, digits = line.rstrip(b"\r\n").removeprefix(b"$").rpartition(b"*")
    if not star or len(digits) not in (2, 4):
        return False
    if not _HEX.issuperset(digits):  # int() also takes blanks and signs
        return False
    return int(digits, 16) == (xor8(body) if len(digits) == 2 else crc16_xmodem(body))


def _binary_layout(packet: bytes) -> tuple[list[tuple[int, int]], int] | int | None:
    """((group, bit) in order, header length), NEED_MORE, or None if a field is unknown."""
    if len(packet) < 2:
        return NEED_MORE
    groups = [group for group in range(8) if packet[1] >> group & 1]
    header = 2 + 2 * len(groups)
    if not groups or any(group not in _SIZES for group in groups):
        return None
    if len(packet) < header:
        return NEED_MORE
    fields = []
    for k, group in enumerate(groups):
        mask = int.from_bytes(packet[2 + 2 * k : 4 + 2 * k], "little")
        bits = [bit for bit in range(16) if mask >> bit & 1]
        if not bits or bits[-1] >= len(_SIZES[group]):
            return None
        fields += [(group, bit) for bit in bits]
    return fields, header


def _match_binary(buffer: bytes, position: int) -> int:
    layout = _binary_layout(buffer[position : position + 18])
    if layout is None:
        return NOT_A_HEAD
    if isinstance(layout, int):
        return layout
    fields, header = layout
    length = header + sum(_SIZES[group][bit] for group, bit in fields) + 2
    if length > _LONGEST_BINARY:
        return TOO_LONG
    packet = buffer[position : position + length]
    if len(packet) < length:
        return NEED_MORE
    return length if crc16_xmodem(packet[1:]) == 0 else BAD_CHECKSUM


@dataclass(frozen=True)
class VectorNavMessage:
    """What a gyro driver needs of a message; None where it is not there.

    ``name`` is "BINARY" or the ASCII name without VN ("YMR", "RRG", "ERR").
    """

    name: str
    rate_rad_s: tuple[float, float, float] | None = None
    time_startup_ns: int | None = None
    ypr_deg: tuple[float, float, float] | None = None
    fields: tuple[str, ...] = ()

    @property
    def error(self) -> str:
        """The error that a $VNERR line reports, in words; "" for other messages."""
        if self.name != "ERR":
            return ""
        # The maker prints the code in decimal (12 = insufficient baud rate); some firmware in hexadecimal.
        text = self.fields[0] if self.fields else "without a code"
        try:
            return ERRORS.get(int(text, 10 if text.isdecimal() else 16), f"error {text}")
        except ValueError:
            return f"error {text}"


def decode_vectornav(packet: bytes) -> VectorNavMessage:
    """Values of a packet as cut by the framer.

    Raises
    ------
    ValueError
        If a number in an ASCII line cannot be read.
    """
    return _decode_binary(packet) if packet[0] == 0xFA else _decode_line(packet)


def _decode_line(line: bytes) -> VectorNavMessage:
    text = line.rstrip(b"\r\n").rpartition(b"*")[0].decode("ascii", errors="replace")
    name, *fields = text.removeprefix("$VN").split(",")
    column = _RATE_COLUMNS.get(name)
    rate = ypr = None
    if column is not None and len(fields) >= column + 3:
        rate = (_number(fields[column]), _number(fields[column + 1]), _number(fields[column + 2]))
    if name == "YMR" and len(fields) >= 3:
        ypr = (_number(fields[0]), _number(fields[1]), _number(fields[2]))
    return VectorNavMessage(name, rate, None, ypr, tuple(fields))


def _number(text: str) -> float:
    """As the device prints one. Raises ValueError for what only Python takes for a number ("1_0")."""
    if "_" in text:
        raise ValueError(f"no number: {text!r}")
    return float(text)


def _decode_binary(packet: bytes) -> VectorNavMessage:
    layout = _binary_layout(packet)
    if not isinstance(layout, tuple):
        raise ValueError(f"not a VectorNav binary packet: {packet[:18].hex()}")
    fields, at = layout
    found: dict[tuple[int, int], bytes] = {}
    for group, bit in fields:
        size = _SIZES[group][bit]
        found[group, bit] = packet[at : at + size]
        at += size

    def triple(*keys: tuple[int, int]) -> tuple[float, float, float] | None:
        data = next((found[key] for key in keys if key in found), None)
        if data is None:
            return None
        x, y, z = struct.unpack("<3f", data)
        return x, y, z

    time_ns = found.get(TIME_STARTUP) or found.get((1, 0))
    return VectorNavMessage(
        "BINARY",
        triple(ANGULAR_RATE, IMU_ANGULAR_RATE),
        int.from_bytes(time_ns, "little") if time_ns else None,
        triple(YAW_PITCH_ROLL),
    )


def encode_line(name: str, *fields: object, wide: bool = False) -> bytes:
    """``$VNRRG,06*XX`` with its checksum, 16-bit if ``wide``."""
    body = ",".join([f"VN{name}", *(str(field) for field in fields)]).encode("ascii")
    digits = f"{crc16_xmodem(body):04X}" if wide else f"{xor8(body):02X}"
    return b"$" + body + b"*" + digits.encode("ascii") + b"\r\n"


def encode_binary_rate(time_startup_ns: int, rate_rad_s: tuple[float, float, float]) -> bytes:
    """Binary output of the common group with TimeStartup and AngularRate."""
    body = b"\x01" + (1 << TIME_STARTUP[1] | 1 << ANGULAR_RATE[1]).to_bytes(2, "little")
    body += time_startup_ns.to_bytes(8, "little") + struct.pack("<3f", *rate_rad_s)
    return b"\xfa" + body + crc16_xmodem(body).to_bytes(2, "big")
