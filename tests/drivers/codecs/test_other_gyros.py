import pytest

from drivers.codecs import kvh1750, vectornav, xbus
from drivers.codecs.framing import StreamFramer
from tests.drivers.wire import WIRE, needs_captures, vectors

VECTORNAV = vectors("VectorNav")
KVH = vectors("KVH")
XSENS = vectors("Xsens")


def ids(rows):
    return [row["id"] for row in rows]


@pytest.mark.parametrize("vector", VECTORNAV, ids=ids(VECTORNAV))
def test_vectornav_packet_decodes_or_is_refused(vector):
    raw = bytes.fromhex(vector["hex"])
    cut = StreamFramer(vectornav.match_vectornav)
    packets = cut.feed(raw)
    if not vector["crc_ok"]:
        assert packets == []
        assert cut.dropped["checksum wrong"] == len(raw)
        return
    [(_, packet)] = packets
    got = vectornav.decode_vectornav(packet)
    want = vector["decoded"] or {}
    if "gyro_rad_s" in want:
        assert list(got.rate_rad_s) == want["gyro_rad_s"]
    if "ypr_deg" in want:
        assert list(got.ypr_deg) == want["ypr_deg"]
    assert got.time_startup_ns == want.get("time_startup_ns")
    if packet[:1] == b"$":
        wide = len(raw.split(b"*")[1].rstrip()) == 4
        assert vectornav.encode_line(got.name, *got.fields, wide=wide) == raw
    if got.name == "ERR":
        assert got.error == "insufficient baud rate for this output"


def test_vectornav_binary_rate_between_ascii_lines_and_garbage():
    binary = vectornav.encode_binary_rate(43_000_006_000, (0.5, -1.25, 3.0))
    line = vectornav.encode_line("GYR", "+0.5", "-1.25", "+3.0")
    cut = StreamFramer(vectornav.match_vectornav)
    got = [vectornav.decode_vectornav(p) for _, p in cut.feed(b"\xfa\x01" + line + b"$VN" + binary + line)]
    assert [m.rate_rad_s for m in got] == [(0.5, -1.25, 3.0)] * len(got)
    assert [m.name for m in got] == ["GYR", "BINARY", "GYR"]
    assert cut.dropped_bytes == 5


@pytest.mark.parametrize("vector", KVH, ids=ids(KVH))
def test_kvh_packet_decodes_to_its_stored_values(vector):
    raw = bytes.fromhex(vector["hex"])
    [(_, packet)] = StreamFramer(kvh1750.match_kvh).feed(b"\xfe\x81" + raw)
    got = kvh1750.decode_kvh(packet)
    want = vector["decoded"]
    if got is None:
        assert packet[-1] == want["checksum"]
        return
    assert list(got.rotation) == want["rot"]
    assert list(got.acceleration_g) == want["acc_g"]
    assert (got.status, got.sequence, got.temperature_c) == (want["status"], want["seq"], want["temp_c"])
    assert kvh1750.encode_kvh(got) == raw


@pytest.mark.parametrize(
    "message",
    [
        kvh1750.KvhMessage("B", (0.5, 1, 2), (0, 0, 1), 0x77, 127, 25, 1_000_000),
        kvh1750.KvhMessage("C", (0.5, 1, 2), (0, 0, 1), 0x37, 0, interleaved=26.5),
    ],
)
def test_kvh_formats_with_timestamp_or_interleaved_field(message):
    [(_, packet)] = StreamFramer(kvh1750.match_kvh).feed(kvh1750.encode_kvh(message))
    assert len(packet) == {"B": 40, "C": 38}[message.format]
    assert kvh1750.decode_kvh(packet) == message


def test_kvh_packet_with_a_flipped_bit_is_refused():
    raw = bytearray(kvh1750.encode_kvh(kvh1750.KvhMessage("A", (0.5, 1, 2), (0, 0, 1), 0x77, 1, 25)))
    raw[9] ^= 1
    cut = StreamFramer(kvh1750.match_kvh)
    assert cut.feed(bytes(raw)) == []
    assert cut.dropped["checksum wrong"] == 36


@pytest.mark.parametrize("vector", XSENS, ids=ids(XSENS))
def test_xsens_packet_gives_the_rate_of_turn(vector):
    [(_, packet)] = StreamFramer(xbus.match_xbus).feed(bytes.fromhex(vector["hex"]))
    assert list(xbus.rate_of_turn(packet)) == vector["decoded"]["rate_of_turn_rad_s"]


@needs_captures
@pytest.mark.parametrize("number", range(1, 6))
def test_xsens_stream_is_stepped_over_without_losing_a_byte(number):
    cut = StreamFramer(xbus.match_xbus)
    raw = (WIRE / f"xsens_mti_einride_{number}.bin").read_bytes()
    packets = [p for at in range(0, len(raw), 37) for _, p in cut.feed(raw[at : at + 37])]
    assert sum(map(len, packets)) + cut.pending_bytes == len(raw)
    assert cut.dropped_bytes == 0
    golden = (WIRE / f"xsens_mti_einride_{number}.golden.txt").read_text()
    assert sum(xbus.rate_of_turn(p) is not None for p in packets) == golden.count("RateOfTurn(")
