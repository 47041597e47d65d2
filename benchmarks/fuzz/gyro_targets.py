"""Gyroscopes under hostile bytes: STIM300 (data, special, service, utility), VectorNav, KVH 1750, Xbus."""

from __future__ import annotations

import struct

from benchmarks.fuzz import checksums
from benchmarks.fuzz.framed import check_driver, check_framing
from benchmarks.fuzz.streams import pieces, reads
from drivers.codecs import kvh1750, stim300, stim300_service, stim300_special, vectornav, xbus
from rig.config.bench import GyroscopeConfig

STIM300_IDENTIFIERS = tuple(stim300.LAYOUTS)
XBUS_LONGEST = 2048 + 7


def stim300_stream(data: bytes) -> int:
    """Normal Mode datagrams of any layout, special ones among them, through framer, decoders and driver."""
    if len(data) < 2:
        return 0
    identifier, ending = STIM300_IDENTIFIERS[data[0] % len(STIM300_IDENTIFIERS)], bool(data[1] & 1)
    bodies = {identifier: stim300.LAYOUTS[identifier].bytes_before_crc} | stim300.SPECIAL_LENGTHS
    specials = tuple(stim300.SPECIAL_LENGTHS)

    def sealed(head: int, body: bytes, tail: bytes) -> bytes:
        text = bytes([head]) + body.ljust(bodies[head] - 1, b"\x5a")[: bodies[head] - 1]
        return text + checksums.stim300_crc(text).to_bytes(4, "big") + tail

    def special(body: bytes) -> bytes:
        head = specials[(body[0] if body else 0) % len(specials)]
        return sealed(head, body[1:], b"\r\n" if head in stim300.SPECIAL_WITH_LINE_ENDING else b"")

    def sound(packet: bytes) -> bool:
        body = bodies.get(packet[0])
        if body is None or packet[body + 4 :] not in (b"", b"\r\n"):
            return False
        return checksums.stim300_crc(packet[:body]) == int.from_bytes(packet[body : body + 4], "big")

    fed = pieces(data[2:], (lambda body: sealed(identifier, body, b"\r\n" if ending else b""), special))
    packets = check_framing(stim300.datagram_matcher((identifier,), ending), fed, sound, 70)
    measured = 0
    for packet in packets:
        if packet[0] == identifier:
            measured += 1
            assert stim300.decode_datagram(packet).identifier == identifier
        else:
            _stim300_special(packet)
    settings = {"datagram": identifier, "line_ending": ending}
    check_driver(GyroscopeConfig(sample_rate_hz=500, settings=settings), reads(fed), measured)
    return len(fed.stream)


def _stim300_special(packet: bytes) -> None:
    for decode in (
        stim300_special.decode_part_number,
        stim300_special.decode_serial_number,
        stim300_special.decode_bias_trim,
        stim300_special.decode_errors,
        stim300_special.decode_configuration,
    ):
        try:
            str(decode(packet))
        except ValueError:
            continue  # another datagram, or a code that the data sheet does not know


def stim300_text(data: bytes) -> int:
    """Service and utility mode: every prefix of an answer, and every message with and without a right CRC."""
    for stop in range(0, len(data), max(1, len(data) // 8)):
        answer = stim300_service.decode_service_answer(data[:stop])
        assert answer is None or all(answer.lines)
    for line in data.split(b"\r"):
        body = (b"#" if len(line) & 1 else b"$") + line + b","
        for message in (line, body + str(checksums.utility_crc(body)).encode()):
            try:
                read = stim300_service.decode_utility(message)
            except ValueError:
                continue
            given = message.rpartition(b",")
            assert checksums.utility_crc(given[0] + b",") == read.crc == int(given[2]), message
    return len(data)


def vectornav_stream(data: bytes) -> int:
    """ASCII lines with both checksums and binary packets of any groups."""

    def line(body: bytes) -> bytes:
        text = b"VN" + body.replace(b"\n", b"")
        return b"$" + text + b"*%02X\r\n" % checksums.nmea_sum(text)

    def wide_line(body: bytes) -> bytes:
        text = b"VN" + body.replace(b"\n", b"")
        return b"$" + text + b"*%04X\r\n" % checksums.vectornav_crc(text)

    def binary(body: bytes) -> bytes:
        return b"\xfa" + body + checksums.vectornav_crc(body).to_bytes(2, "big")

    def rate(body: bytes) -> bytes:
        return binary(b"\x01\x21\x00" + body.ljust(20, b"\0")[:20])

    fed = pieces(data, (line, wide_line, binary, rate))
    packets = check_framing(vectornav.match_vectornav, fed, vectornav_sound, 600)
    for packet in packets:
        try:
            message = vectornav.decode_vectornav(packet)
        except ValueError:
            continue
        str(message.error)
    check_driver(GyroscopeConfig(device="vectornav"), reads(fed), len(packets))
    return len(fed.stream)


def vectornav_sound(packet: bytes) -> bool:
    """Whether a packet has one of the protocol's three checksums, and the right one."""
    if packet[0] == 0xFA:
        return checksums.vectornav_crc(packet[1:-2]) == int.from_bytes(packet[-2:], "big")
    body, _, digits = packet.rstrip(b"\r\n")[1:].rpartition(b"*")
    if any(digit not in b"0123456789abcdefABCDEF" for digit in digits):
        return False
    expected = {2: checksums.nmea_sum, 4: checksums.vectornav_crc}.get(len(digits))
    return expected is not None and expected(body) == int(digits, 16)


def kvh_stream(data: bytes) -> int:
    """Formats A, B, C and the built-in-test replies."""
    formats = (("A", 36), ("B", 40), ("C", 38), ("BIT", 11), ("BIT2", 13))
    heads = dict(zip("ABC", (b"\xfe\x81\xff\x55", b"\xfe\x81\xff\x56", b"\xfe\x81\xff\x57"), strict=True))
    heads |= {"BIT": b"\xfe\x81\x00\xaa", "BIT2": b"\xfe\x81\x00\xab"}

    def sealed(body: bytes) -> bytes:
        kind, length = formats[(body[0] if body else 0) % len(formats)]
        tail = 1 if kind.startswith("BIT") else 4
        text = heads[kind] + body[1:].ljust(length - 4 - tail, b"\0")[: length - 4 - tail]
        return text + (bytes([checksums.byte_sum(text)]) if tail == 1 else checksums.kvh_crc(text).to_bytes(4, "big"))

    def sound(packet: bytes) -> bool:
        if packet[2] == 0:
            return checksums.byte_sum(packet[:-1]) == packet[-1]
        return checksums.kvh_crc(packet[:-4]) == int.from_bytes(packet[-4:], "big")

    fed = pieces(data, (sealed,))
    packets = check_framing(kvh1750.match_kvh, fed, sound, 41)
    measured = sum(kvh1750.decode_kvh(packet) is not None for packet in packets)
    check_driver(GyroscopeConfig(device="kvh1750"), reads(fed), measured)
    return len(fed.stream)


def xbus_stream(data: bytes) -> int:
    """Messages of any identifier and of both lengths, MTData2 among them."""

    def sealed(body: bytes) -> bytes:
        long = len(body) > 0 and body[0] & 1
        length = b"\xff" + len(body[2:]).to_bytes(2, "big") if long else bytes([min(len(body[2:]), 254)])
        text = b"\xff" + (body[1:2] or b"\x36") + length + body[2:]
        return b"\xfa" + text + bytes([-checksums.byte_sum(text) & 0xFF])

    def mtdata2(body: bytes) -> bytes:
        kind = (body[0] if body else 0) & 3
        values = body[1:].ljust((12, 12, 18, 24)[kind], b"\x11")[: (12, 12, 18, 24)[kind]]
        return sealed(b"\0\x36" + struct.pack(">HB", 0x8020 | kind, len(values)) + values)

    def sound(packet: bytes) -> bool:
        return packet[:2] == b"\xfa\xff" and checksums.byte_sum(packet[1:]) == 0

    fed = pieces(data, (sealed, mtdata2))
    for packet in check_framing(xbus.match_xbus, fed, sound, XBUS_LONGEST):
        rate = xbus.rate_of_turn(packet)
        assert rate is None or len(rate) == 3
    return len(fed.stream)
