import itertools
import random
from dataclasses import replace

import pytest

from drivers.codecs import stim300, stim300_service, stim300_special
from drivers.codecs.framing import StreamFramer
from tests.drivers.wire import WIRE, needs_captures, vectors

STIM = vectors("STIM300")
NORMAL = [v for v in STIM if v["crc_ok"] and "Utility" not in v["protocol"]]
UTILITY = [v for v in STIM if "Utility" in v["protocol"]]


def framer(*identifiers, line_ending=False):
    return StreamFramer(stim300.datagram_matcher(identifiers, line_ending))


def sample(identifier=0x93, counter=7, rate=(100, -200, 300), status=0):
    return stim300.Datagram(identifier, rate, status, counter, 506)


@pytest.mark.parametrize("vector", NORMAL, ids=[v["id"] for v in NORMAL])
def test_captured_datagram_decodes_to_its_stored_values(vector):
    raw = bytes.fromhex(vector["hex"])
    cut = framer(raw[0], line_ending=raw.endswith(b"\r\n"))
    [(offset, packet)] = cut.feed(raw)
    assert (offset, packet, cut.dropped_bytes) == (0, raw, 0)
    got, want = stim300.decode_datagram(packet), vector["decoded"]
    assert list(got.rate_deg_s) == want["gyro_dps"]
    assert got.counter == want["counter"]
    assert got.latency_us == want["latency_us"]
    assert [x * stim300.INCLINATION_LSB_G for x in got.inclination] == want["incl_g"]
    if "gyro_status" in want:
        statuses = got.gyro_status, got.acceleration_status, got.inclination_status
        assert statuses == (want["gyro_status"], want["acc_status"], want["incl_status"])
        assert list(got.acceleration) == want["acc_raw24"]
    else:
        lsb = stim300.ACCELERATION_LSB_G[10]
        assert [x * lsb for x in got.acceleration] == want["acc_g_10g"]
        for name in ("gyro", "acceleration", "inclination"):
            key = {"gyro": "gyro", "acceleration": "acc", "inclination": "incl"}[name] + "_temp_c"
            assert [t * stim300.TEMPERATURE_LSB_C for t in getattr(got, f"{name}_temperature")] == want[key]
        assert list(got.auxiliary.to_bytes(3, "big")) == want["aux"]
    assert stim300.encode_datagram(got, raw.endswith(b"\r\n")) == raw


@needs_captures
@pytest.mark.parametrize("vector", [v for v in STIM if v["crc_ok"] is False], ids=lambda v: v["id"])
def test_datagram_with_a_broken_crc_is_refused(vector):
    raw = bytes.fromhex(vector["hex"])
    cut = framer(0x93, line_ending=True)
    assert cut.feed(raw) == []
    cut.flush()
    assert cut.dropped_bytes == len(raw)
    assert cut.dropped["checksum wrong"] > 0


@needs_captures
@pytest.mark.parametrize(
    ("name", "datagrams", "start_up", "step", "cut_at_the_end"),
    [("stim300_ubc_2000hz.bin", 8392, 562, 1, 28), ("stim300_ubc_125hz.bin", 524, 0, 16, 0)],
)
def test_real_log_comes_through_whole_and_start_up_is_rejected_by_status_not_by_crc(
    name, datagrams, start_up, step, cut_at_the_end
):
    cut = framer(0x93, line_ending=True)
    raw = (WIRE / name).read_bytes()
    sizes = random.Random(1)
    packets, at = [], 0
    while at < len(raw):
        size = sizes.randint(1, 200)
        packets += cut.feed(raw[at : at + size])
        at += size
    got = [stim300.decode_datagram(packet) for _, packet in packets]
    assert len(got) == datagrams
    assert cut.dropped_bytes == 0
    assert cut.pending_bytes == cut_at_the_end
    assert sum(not stim300.axis_is_good(d.gyro_status, "z") for d in got) == start_up
    assert {(b.counter - a.counter) % 256 for a, b in itertools.pairwise(got)} == {step}


@pytest.mark.parametrize("identifier", stim300.LAYOUTS, ids=hex)
@pytest.mark.parametrize("line_ending", [False, True])
def test_every_datagram_type_survives_encoding_and_cutting(identifier, line_ending):
    first = replace(sample(identifier), acceleration_status=3)
    raw = stim300.encode_datagram(first, line_ending)
    assert len(raw) == stim300.LAYOUTS[identifier].length + 2 * line_ending
    [(_, packet)] = framer(identifier, line_ending=line_ending).feed(raw)
    got = stim300.decode_datagram(packet)
    assert (got.gyro, got.counter, got.latency_us) == (first.gyro, first.counter, first.latency_us)


def test_lengths_are_those_of_the_datasheet():
    lengths = {i: stim300.LAYOUTS[i].length for i in (0x90, 0x91, 0x92, 0x93, 0x94, 0xA7, 0xAF, 0xF7)}
    assert lengths == {0x90: 18, 0x91: 28, 0x92: 28, 0x93: 38, 0x94: 25, 0xA7: 59, 0xAF: 63, 0xF7: 63}


def test_framer_finds_the_next_datagram_after_garbage_and_says_what_it_dropped():
    good = [stim300.encode_datagram(sample(counter=k)) for k in range(4)]
    spoiled = bytearray(good[1])
    spoiled[5] ^= 0x40
    cut = framer(0x93)
    packets = cut.feed(b"\x93\x93junk" + good[0] + bytes(spoiled) + good[2][:20] + good[3])
    assert [p for _, p in packets] == [good[0], good[3]]
    assert [(d.offset, d.count, d.reason) for d in cut.recent_drops] == [
        (0, 6, "checksum wrong"),
        (44, 58, "checksum wrong"),
    ]


def test_special_datagram_is_cut_out_of_the_data_stream():
    special = stim300_special.encode_serial_number("N25581846020021")
    data = stim300.encode_datagram(sample(0x90))
    packets = [p for _, p in framer(0x90).feed(data + special + data)]
    assert packets == [data, special, data]
    assert stim300_special.decode_serial_number(special) == "N25581846020021"


def test_configuration_datagram_round_trip():
    said = stim300_special.Stim300Configuration(
        "C", 12, 2000, 0xF5, True, 921_600, "incremental_angle_delayed", (262, 33, 16), (10, 5, 30)
    )
    raw = stim300_special.encode_configuration(said)
    assert len(raw) == 28
    assert stim300_special.decode_configuration(raw) == said


def test_status_byte_in_words_and_by_axis():
    assert stim300.status_in_words(0) == ""
    assert stim300.status_in_words(0b0101_0100) == "start-up, overload, Z axis"
    assert not stim300.axis_is_good(0b0100_0000, "z")
    assert not stim300.axis_is_good(0b0001_0100, "z")
    assert stim300.axis_is_good(0b0001_0001, "z"), "an overload of X leaves Z good"
    assert not stim300.axis_is_good(0b0000_1000, "z"), "an error that names no axis concerns all"


@pytest.mark.parametrize("vector", UTILITY, ids=[v["id"] for v in UTILITY])
def test_utility_message_of_the_datasheet_decodes_and_encodes(vector):
    raw = bytes.fromhex(vector["hex"])
    got = stim300_service.decode_utility(raw)
    assert got.crc == vector["decoded"]["crc"]
    fields = got.parameters if got.status is None else (got.status, *got.parameters)
    assert stim300_service.encode_utility(got.name, *fields, answer=got.is_answer) == raw


def test_utility_message_with_a_wrong_crc_is_refused():
    with pytest.raises(ValueError, match="CRC 29, computed 28"):
        stim300_service.decode_utility(b"$isn,29\r")


def test_service_mode_answers():
    assert stim300_service.encode_service_command("d", 3, 1) == b"d 3,1\r"
    assert stim300_service.decode_service_answer(b"DATAGRAM = RATE\r") is None
    answer = stim300_service.decode_service_answer(b"E007 DATAGRAM WILL BE TOO LONG\r\r>")
    assert answer.error == "E007 DATAGRAM WILL BE TOO LONG"
    with pytest.raises(ValueError, match="allowed: a b c"):
        stim300_service.encode_service_command("q")
