"""STIM300 datagrams sent on request: part and serial number, configuration, bias trim, errors.

Datasheet TS1524 rev. 31, tables 5-13 to 5-19. They take the place of a data datagram.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.codecs.stim300 import (
    INCLINATION_LSB_G,
    LAYOUTS,
    RATE_LSB_DEG_S,
    SPECIAL_LENGTHS,
    SPECIAL_WITH_LINE_ENDING,
    datagram_crc,
)

PART_NUMBER_IDS = (0xB1, 0xB3)
SERIAL_NUMBER_IDS = (0xB5, 0xB7)
CONFIGURATION_IDS = (0xBC, 0xBD)
BIAS_TRIM_IDS = (0xD1, 0xD2)
ERROR_IDS = (0xBE, 0xBF)

REQUESTS = {
    "part_number": b"N\r",
    "serial_number": b"I\r",
    "configuration": b"C\r",
    "bias_trim": b"T\r",
    "errors": b"E\r",
    "reset": b"R\r",
    "service_mode": b"SERVICEMODE\r",
    "utility_mode": b"UTILITYMODE\r",
}
"""Commands of Normal Mode. The device neither echoes them nor answers a wrong one."""

_SAMPLE_RATES_HZ = {0: 125, 1: 250, 2: 500, 3: 1000, 4: 2000, 5: 0}
_BIT_RATES = {0: 374_400, 1: 460_800, 2: 921_600, 3: 1_843_200, 15: 0}
_FILTERS_HZ = {0: 16, 1: 33, 2: 66, 3: 131, 4: 262}
_ACCELERATION_RANGES_G = {0b0000: 10, 0b0011: 5, 0b0100: 30, 0b0110: 80}
GYRO_UNITS = {
    0b0000: "angular_rate",
    0b0001: "incremental_angle",
    0b0010: "average_rate",
    0b0011: "integrated_angle",
    0b1000: "angular_rate_delayed",
    0b1001: "incremental_angle_delayed",
    0b1010: "average_rate_delayed",
    0b1011: "integrated_angle_delayed",
}


@dataclass(frozen=True)
class Stim300Configuration:
    """The device's own settings (table 5-16); a rate of 0 means external trigger or user-defined."""

    revision: str
    firmware: int
    sample_rate_hz: int
    identifier: int
    line_ending: bool
    bit_rate: int
    gyro_unit: str
    gyro_filter_hz: tuple[int, int, int]
    acceleration_range_g: tuple[int, int, int]

    def __str__(self) -> str:
        rate = f"{self.sample_rate_hz} samples/s" if self.sample_rate_hz else "external trigger or a rate of its own"
        filters = "/".join(map(str, self.gyro_filter_hz))
        return (
            f"firmware {self.firmware} (revision {self.revision}), datagram 0x{self.identifier:02X} "
            f"{'with' if self.line_ending else 'without'} line ending, {rate}, {self.bit_rate} baud, "
            f"{self.gyro_unit.replace('_', ' ')}, filters {filters} Hz"
        )


def _payload(packet: bytes, identifiers: tuple[int, ...]) -> bytes:
    if not packet or packet[0] not in identifiers or len(packet) < SPECIAL_LENGTHS[packet[0]] + 4:
        raise ValueError(f"not a STIM300 special datagram of {[hex(i) for i in identifiers]}: {packet.hex()}")
    return packet[1 : SPECIAL_LENGTHS[packet[0]]]


def _with_crc(identifier: int, payload: bytes) -> bytes:
    body = bytes([identifier]) + payload
    if len(body) != SPECIAL_LENGTHS[identifier]:
        raise ValueError(f"0x{identifier:02X} takes {SPECIAL_LENGTHS[identifier] - 1} bytes, got {len(payload)}")
    ending = b"\r\n" if identifier in SPECIAL_WITH_LINE_ENDING else b""
    return body + datagram_crc(body).to_bytes(4, "big") + ending


def decode_configuration(packet: bytes) -> Stim300Configuration:
    """Settings from a Configuration datagram.

    Raises
    ------
    ValueError
        If it is another datagram, or a field holds a value that the datasheet does not know.
    """
    b = _payload(packet, CONFIGURATION_IDS)
    content = b[2] >> 1 & 0xF  # PPS, temperature, inclination, acceleration
    wanted = ("pps" if content & 8 else "", bool(content & 4), bool(content & 2), bool(content & 1))
    identifier = next(
        i for i, lay in LAYOUTS.items() if (lay.auxiliary, lay.temperature, lay.inclination, lay.acceleration) == wanted
    )
    try:
        return Stim300Configuration(
            revision=chr(b[0]),
            firmware=b[1],
            sample_rate_hz=_SAMPLE_RATES_HZ[b[2] >> 5],
            identifier=identifier,
            line_ending=bool(b[2] & 1),
            bit_rate=_BIT_RATES[b[3] >> 4],
            gyro_unit=GYRO_UNITS[b[4] & 0xF],
            gyro_filter_hz=(_FILTERS_HZ[b[5] >> 4 & 7], _FILTERS_HZ[b[5] & 7], _FILTERS_HZ[b[6] >> 4 & 7]),
            acceleration_range_g=(
                _ACCELERATION_RANGES_G[b[16] >> 4],
                _ACCELERATION_RANGES_G[b[16] & 0xF],
                _ACCELERATION_RANGES_G[b[17] >> 4],
            ),
        )
    except KeyError as unknown:
        raise ValueError(f"STIM300 configuration datagram {packet.hex()}: unknown code {unknown}") from None


def encode_configuration(configuration: Stim300Configuration) -> bytes:
    """The Configuration datagram that says this (the fields that we do not keep are zero)."""

    def code(table: dict[int, int] | dict[int, str], value: int | str) -> int:
        return next(k for k, v in table.items() if v == value)

    layout = LAYOUTS[configuration.identifier]
    b = bytearray(21)
    b[0], b[1] = ord(configuration.revision), configuration.firmware
    content = (layout.auxiliary == "pps", layout.temperature, layout.inclination, layout.acceleration)
    for bit in content:
        b[2] = b[2] << 1 | bit
    b[2] = code(_SAMPLE_RATES_HZ, configuration.sample_rate_hz) << 5 | b[2] << 1 | configuration.line_ending
    b[3] = code(_BIT_RATES, configuration.bit_rate) << 4
    b[4] = 0x70 | code(GYRO_UNITS, configuration.gyro_unit)
    x, y, z = (code(_FILTERS_HZ, hz) for hz in configuration.gyro_filter_hz)
    b[5], b[6] = x << 4 | y, z << 4
    x, y, z = (code(_ACCELERATION_RANGES_G, g) for g in configuration.acceleration_range_g)
    b[16], b[17] = x << 4 | y, z << 4
    return _with_crc(CONFIGURATION_IDS[configuration.line_ending], bytes(b))


def _digit(value: int) -> str:
    return chr(value + (48 if value < 10 else 55))


def decode_part_number(packet: bytes) -> str:
    """Part number with its revision, as in "84166-440000-001-" (tables 5-13, 5-14)."""
    b = _payload(packet, PART_NUMBER_IDS)
    head = [b[0] & 15, *(n for byte in b[1:3] for n in (byte >> 4, byte & 15))]
    middle = [n for byte in b[4:7] for n in (byte >> 4, byte & 15)]
    tail = [b[10] & 15, (b[10] >> 4) * 16 + (b[8] >> 4), b[8] & 15, (b[9] & 15) * 16 + (b[9] >> 4)]
    first, second = "".join(map(_digit, head)), "".join(map(_digit, middle)) + _digit(tail[0])
    return f"{first}-{second}-{''.join(map(_digit, tail[1:]))} rev {chr(b[14])}"


def decode_serial_number(packet: bytes) -> str:
    """Serial number, as in "N25581846020021" (table 5-15)."""
    b = _payload(packet, SERIAL_NUMBER_IDS)
    return chr(b[0]) + b[1:8].hex().upper()


def encode_serial_number(serial: str, line_ending: bool = False) -> bytes:
    """A Serial Number datagram for "N" and fourteen digits."""
    payload = serial[0].encode("ascii") + bytes.fromhex(serial[1:]) + bytes(7)
    return _with_crc(SERIAL_NUMBER_IDS[line_ending], payload)


@dataclass(frozen=True)
class BiasTrim:
    """Bias trim offsets in deg/s and g (table 5-17)."""

    rate_deg_s: tuple[float, float, float]
    acceleration_g: tuple[float, float, float]
    inclination_g: tuple[float, float, float]
    saves_left: int


def decode_bias_trim(packet: bytes) -> BiasTrim:
    """Offsets that the device subtracts by itself."""
    b = _payload(packet, BIAS_TRIM_IDS)
    raw = [int.from_bytes(b[k : k + 3], "big", signed=True) for k in range(0, 27, 3)]

    def scaled(start: int, lsb: float) -> tuple[float, float, float]:
        return raw[start] * lsb, raw[start + 1] * lsb, raw[start + 2] * lsb

    return BiasTrim(
        scaled(0, RATE_LSB_DEG_S), scaled(3, 2.0**-19), scaled(6, INCLINATION_LSB_G),
        int.from_bytes(b[31:33], "big"),
    )  # fmt: skip


ERROR_WORDS = {
    112: "PPS time overflow", 111: "reference voltage 4", 109: "inclinometer Z overload",
    108: "inclinometer Y overload", 107: "inclinometer X overload", 106: "accelerometer Z overload",
    105: "accelerometer Y overload", 104: "accelerometer X overload", 103: "gyro Z overload",
    102: "gyro Y overload", 101: "gyro X overload", 100: "gyro Z configuration",
    99: "gyro Y configuration", 98: "gyro X configuration", 97: "microcontroller temperature",
    85: "self-test not running", 68: "UART unable to transmit", 67: "gyro Z data missing",
    66: "gyro Y data missing", 65: "gyro X data missing", 59: "supply overvoltage", 57: "flash check",
    56: "RAM check", 44: "gyro Z data lost", 37: "gyro Y data lost", 30: "gyro X data lost",
    20: "supply voltage", 16: "start-up phase active", 12: "gyro Z clipped", 11: "gyro Y clipped",
    10: "gyro X clipped", 3: "microcontroller temperature limit", 2: "gyro Z excitation frequency",
    1: "gyro Y excitation frequency", 0: "gyro X excitation frequency",
}  # fmt: skip
"""Table 5-19, the bits that a bench meets; others are given by number."""


def decode_errors(packet: bytes) -> tuple[str, ...]:
    """Set bits of the extended error register in words."""
    register = int.from_bytes(_payload(packet, ERROR_IDS), "big")
    return tuple(ERROR_WORDS.get(bit, f"error bit E{bit}") for bit in range(128) if register >> bit & 1)
