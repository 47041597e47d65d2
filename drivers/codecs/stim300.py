"""Sensonor STIM300: the datagrams of Normal Mode (datasheet TS1524 rev. 31, sections 5.5.6, 5.5.7, 7.5.2.2).

    ID | gyro 3 x int24, status | [acc ...] [incl ...] | [temperatures 3 x int16, status, per cluster] |
    [PPS or AUX 3 bytes, status] | counter u8 | latency u16 us | CRC-32/MPEG-2 | [CR LF]

Values are big-endian. The CRC covers everything before it, padded with 0x00 to a multiple of four; the
padding is not sent. Frames of the power-on phase carry a *right* CRC and rates of +-480 deg/s: a sample is
good only when both the CRC and the status byte say so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from drivers.codecs.checksums import crc32_mpeg2
from drivers.codecs.framing import BAD_CHECKSUM, BAD_ENDING, NEED_MORE, NOT_A_HEAD, Matcher

INTERNAL_RATE_HZ = 2000
"""The counter counts these internal samples, whatever the output rate."""

FULL_SCALE_DEG_S = 400.0
SATURATION_DEG_S = 480.0
RATE_LSB_DEG_S = 2.0**-14
INCREMENT_LSB_DEG = 2.0**-21
INCLINATION_LSB_G = 2.0**-22
TEMPERATURE_LSB_C = 2.0**-8
ACCELERATION_LSB_G = {5: 2.0**-20, 10: 2.0**-19, 30: 2.0**-18, 80: 2.0**-16}

GROUP_DELAY_S = {262: 2.2e-3, 131: 3.7e-3, 66: 6.7e-3, 33: 12.7e-3, 16: 24.7e-3}
"""Group delay of the gyro by the -3 dB frequency of its low-pass in Hz (datasheet, gyro specification)."""

DELAYED_OUTPUT_S = 4.0e-3
"""Further delay of the output units called "delayed"."""

GyroUnit = Literal["angular_rate", "incremental_angle"]

STATUS_BITS = {
    7: "system integrity error",
    6: "start-up",
    5: "outside operating conditions",
    4: "overload",
    3: "error in measurement channel",
    2: "Z axis",
    1: "Y axis",
    0: "X axis",
}


@dataclass(frozen=True)
class Layout:
    """What one datagram identifier carries, and where."""

    identifier: int
    acceleration: bool
    inclination: bool
    temperature: bool
    auxiliary: Literal["", "pps", "aux"] = ""

    @property
    def clusters(self) -> int:
        return 1 + self.acceleration + self.inclination

    @property
    def bytes_before_crc(self) -> int:
        per_cluster = 10 + (7 if self.temperature else 0)
        return 1 + per_cluster * self.clusters + (4 if self.auxiliary else 0) + 3

    @property
    def length(self) -> int:
        """Bytes on the wire, CRC included, line ending not."""
        return self.bytes_before_crc + 4


def _layouts() -> dict[int, Layout]:
    contents = [
        (acceleration, inclination, temperature)
        for temperature in (False, True)
        for inclination in (False, True)
        for acceleration in (False, True)
    ]
    plain = (0x90, 0x91, 0x92, 0x93, 0x94, 0xA5, 0xA6, 0xA7)
    aux = (0x98, 0x99, 0x9A, 0x9B, 0x9C, 0xAD, 0xAE, 0xAF)  # firmware before the PPS input
    pps = (0xF0, 0xF1, 0xF2, 0xF3, 0xF4, 0xF5, 0xF6, 0xF7)
    table = {i: Layout(i, *c) for i, c in zip(plain, contents, strict=True)}
    table |= {i: Layout(i, *c, "aux") for i, c in zip(aux, contents, strict=True)}
    table |= {i: Layout(i, *c, "pps") for i, c in zip(pps, contents, strict=True)}
    return table


LAYOUTS = _layouts()

_DUMMIES = (b"", b"\0\0\0", b"\0\0", b"\0")


def datagram_crc(body: bytes) -> int:
    """CRC of a datagram's bytes before the CRC field, dummy bytes included."""
    return crc32_mpeg2(body + _DUMMIES[len(body) & 3])


def datagram_matcher(identifiers: tuple[int, ...], line_ending: bool, special: bool = True) -> Matcher:
    """A matcher for the framer: these identifiers (and, if ``special``, those sent on request).

    The identifier also occurs inside 7 % of real frames, hence the CRC decides.
    """
    lengths: dict[int, int] = {i: LAYOUTS[i].bytes_before_crc for i in identifiers}
    endings: dict[int, int] = dict.fromkeys(identifiers, 2 if line_ending else 0)
    if special:
        lengths |= SPECIAL_LENGTHS
        endings |= {i: 2 if i in SPECIAL_WITH_LINE_ENDING else 0 for i in SPECIAL_LENGTHS}

    def match(buffer: bytes, position: int) -> int:
        body = lengths.get(buffer[position])
        if body is None:
            return NOT_A_HEAD
        crc_at = position + body
        stop = crc_at + 4
        ending = endings[buffer[position]]
        if len(buffer) < stop + ending:
            return NEED_MORE
        if datagram_crc(buffer[position:crc_at]) != int.from_bytes(buffer[crc_at:stop], "big"):
            return BAD_CHECKSUM
        if ending and buffer[stop : stop + 2] != b"\r\n":
            return BAD_ENDING
        return body + 4 + ending

    return match


SPECIAL_LENGTHS = {
    0xB1: 16, 0xB3: 16,  # part number
    0xB5: 16, 0xB7: 16,  # serial number
    0xBC: 22, 0xBD: 22,  # configuration
    0xD1: 36, 0xD2: 36,  # bias trim offset
    0xBE: 17, 0xBF: 17,  # extended error information
}  # fmt: skip
"""Datagrams sent on request, in the place of a data datagram: bytes before the CRC."""

SPECIAL_WITH_LINE_ENDING = frozenset((0xB3, 0xB7, 0xBD, 0xD2, 0xBF))


@dataclass(frozen=True)
class Datagram:
    """One Normal Mode datagram as integers of the wire; scale with the constants of this module.

    ``gyro`` is int24 x 3: times RATE_LSB_DEG_S for a rate, INCREMENT_LSB_DEG for an incremental angle.
    """

    identifier: int
    gyro: tuple[int, int, int]
    gyro_status: int
    counter: int
    latency_us: int
    acceleration: tuple[int, int, int] | None = None
    acceleration_status: int = 0
    inclination: tuple[int, int, int] | None = None
    inclination_status: int = 0
    gyro_temperature: tuple[int, int, int] | None = None
    gyro_temperature_status: int = 0
    acceleration_temperature: tuple[int, int, int] | None = None
    acceleration_temperature_status: int = 0
    inclination_temperature: tuple[int, int, int] | None = None
    inclination_temperature_status: int = 0
    auxiliary: int | None = None
    auxiliary_status: int = 0

    @property
    def rate_deg_s(self) -> tuple[float, float, float]:
        """Angular rate of the three axes, deg/s."""
        x, y, z = self.gyro
        return x * RATE_LSB_DEG_S, y * RATE_LSB_DEG_S, z * RATE_LSB_DEG_S


_FIELDS = (
    ("gyro", 3),
    ("acceleration", 3),
    ("inclination", 3),
    ("gyro_temperature", 2),
    ("acceleration_temperature", 2),
    ("inclination_temperature", 2),
)


def _present(layout: Layout) -> list[tuple[str, int]]:
    has = (
        True,
        layout.acceleration,
        layout.inclination,
        layout.temperature,
        layout.temperature and layout.acceleration,
        layout.temperature and layout.inclination,
    )
    return [field for field, there in zip(_FIELDS, has, strict=True) if there]


def decode_datagram(packet: bytes) -> Datagram:
    """Values of one packet as cut by the framer (its CRC is taken as checked).

    Raises
    ------
    ValueError
        If the identifier is unknown or the packet is too short.
    """
    layout = LAYOUTS.get(packet[0]) if packet else None
    if layout is None or len(packet) < layout.length:
        raise ValueError(f"not a STIM300 Normal Mode datagram: {packet[:8].hex()}... of {len(packet)} bytes")
    values: dict[str, tuple[int, int, int] | int] = {}
    at = 1
    for name, width in _present(layout):
        triple = [int.from_bytes(packet[at + k * width : at + (k + 1) * width], "big", signed=True) for k in range(3)]
        values[name] = (triple[0], triple[1], triple[2])
        values[f"{name}_status"] = packet[at + 3 * width]
        at += 3 * width + 1
    if layout.auxiliary:
        values["auxiliary"] = int.from_bytes(packet[at : at + 3], "big")
        values["auxiliary_status"] = packet[at + 3]
        at += 4
    return Datagram(
        identifier=packet[0],
        counter=packet[at],
        latency_us=int.from_bytes(packet[at + 1 : at + 3], "big"),
        **values,  # type: ignore[arg-type]
    )


def encode_datagram(datagram: Datagram, line_ending: bool = False) -> bytes:
    """The packet as the device would send it; carried fields that are None are sent as zero."""
    layout = LAYOUTS[datagram.identifier]
    body = bytearray([datagram.identifier])
    for name, width in _present(layout):
        for value in getattr(datagram, name) or (0, 0, 0):
            body += value.to_bytes(width, "big", signed=True)
        body.append(getattr(datagram, f"{name}_status"))
    if layout.auxiliary:
        body += (datagram.auxiliary or 0).to_bytes(3, "big") + bytes([datagram.auxiliary_status])
    body.append(datagram.counter & 0xFF)
    body += datagram.latency_us.to_bytes(2, "big")
    crc = datagram_crc(bytes(body)).to_bytes(4, "big")
    return bytes(body) + crc + (b"\r\n" if line_ending else b"")


def status_in_words(status: int) -> str:
    """The status byte of a cluster as text, highest bit first; "" when all is well."""
    return ", ".join(text for bit, text in STATUS_BITS.items() if status >> bit & 1)


AXIS_BIT = {"x": 0b001, "y": 0b010, "z": 0b100}
GENERAL_BITS = 0b1110_0000


def axis_is_good(status: int, axis: Literal["x", "y", "z"]) -> bool:
    """True if the status byte leaves this axis usable.

    Integrity, start-up and operating conditions concern the whole device. Overload and channel error name
    their axes in bits 0 to 2, so an overload of X alone leaves Z good; where they name none, none is good.
    """
    if status == 0:
        return True
    return not status & GENERAL_BITS and bool(status & 0b111) and not status & AXIS_BIT[axis]
