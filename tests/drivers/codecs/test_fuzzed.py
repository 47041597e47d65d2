"""What hostile bytes were once accepted or not survived, and must not be again (found by benchmarks/fuzz_codecs.py)."""

from __future__ import annotations

import math

import pytest

from drivers.amplifiers.moteus import decode_registers
from drivers.codecs import lawicel, stim300, vectornav
from drivers.codecs.checksums import xor8
from drivers.codecs.lawicel import Answer, CanFrame, LawicelDecoder, decode_line
from drivers.codecs.stim300_special import _with_crc
from drivers.gyroscopes import make_gyroscope
from rig.config.bench import GyroscopeConfig


@pytest.mark.parametrize(
    "line",
    [b"t-128" + b"00" * 8, b"t+122AABB", b"t 122AABB", b"t1_22AABB", b"T-00000012AABB", b"t1231AA+123", b"t1231AA 12 ",
     b"d-128" + b"00" * 8, b"d123+00", b"DFFFFFFFF100", b"d8001AA", b"d12", b"D"],
)  # fmt: skip
def test_only_hexadecimal_digits_make_a_frame(line: bytes) -> None:
    assert isinstance(decode_line(line), str)


def test_what_devices_send_is_still_a_frame() -> None:
    assert decode_line(b"t1812AABB") == CanFrame(0x181, b"\xaa\xbb", length=2)
    assert decode_line(b"t1812aabb12Ff") == CanFrame(0x181, b"\xaa\xbb", length=2, timestamp_ms=0x12FF)
    assert decode_line(b"D1FFFFFFF9" + b"00" * 12) == CanFrame(0x1FFFFFFF, bytes(12), extended=True, length=12, fd=True)


def test_flags_that_are_no_number_are_no_answer() -> None:
    items = LawicelDecoder().feed(b"F2z\rF\rF20\r")
    assert items == [Answer("F", ""), Answer("F", "20")]
    assert [lawicel.flags_in_words(item.text) for item in items if isinstance(item, Answer)] == ["", "error passive"]


@pytest.mark.parametrize("code", ["zz", "", "1_2", "-1", "\N{SUPERSCRIPT TWO}"])
def test_an_error_code_of_nonsense_is_quoted(code: str) -> None:
    assert vectornav.VectorNavMessage("ERR", fields=(code,) if code else ()).error.startswith("error ")


def test_numbers_that_only_python_reads_are_refused() -> None:
    for field in ("1_0", "1.YMR", ""):
        with pytest.raises(ValueError, match=r"no number|convert"):
            vectornav.decode_vectornav(vectornav.encode_line("GYR", field, 2.0, 3.0))


@pytest.mark.parametrize("reply", ["20", "24", "2c", "2c02", "2000", "2503", "2f00"])
def test_a_moteus_reply_that_is_cut_anywhere_is_refused(reply: str) -> None:
    with pytest.raises(ValueError, match="cut off"):
        decode_registers(bytes.fromhex(reply))


def test_nonsense_with_a_right_checksum_does_not_stop_a_gyroscope() -> None:
    gyro = make_gyroscope(GyroscopeConfig(settings={"datagram": 0x90}))
    unknown = _with_crc(0xBC, bytes([65, 1, 0x60, 0xF0, 0x70]) + b"\x5a" * 16)  # codes that no data sheet knows
    datagram = stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, 100), 0, 7, 500))
    samples = gyro.feed(unknown + datagram, 1.0)
    assert [sample.valid for sample in samples] == [True]
    assert "unknown code" in gyro.counts.last_reason
    other = make_gyroscope(GyroscopeConfig(device="vectornav"))
    lines = vectornav.encode_line("GYR", "x", 1, 2) + vectornav.encode_line("ERR", "zz")
    assert other.feed(lines + vectornav.encode_line("GYR", 1, 2, 3), 1.0)[-1].valid


def test_a_counter_that_leaps_is_a_new_start_and_no_thousand_lost_samples() -> None:
    gyro = make_gyroscope(GyroscopeConfig(device="vectornav"))
    gyro.feed(vectornav.encode_binary_rate(10**9, (0.0, 0.0, 0.1)), 1.0)
    samples = gyro.feed(vectornav.encode_binary_rate(2**63, (0.0, 0.0, 0.1)), 1.01)
    assert len(samples) == 1 and math.isfinite(samples[0].time_s)


@pytest.mark.parametrize("digits", [b"+5", b" 5", b"5 ", b"_5", b"-5"])
def test_only_hexadecimal_digits_are_a_checksum(digits: bytes) -> None:
    body = b"VNRRG" + bytes([5 ^ xor8(b"VNRRG")])
    assert vectornav.line_checksum_is_right(b"$" + body + b"*05\r\n")
    assert not vectornav.line_checksum_is_right(b"$" + body + b"*" + digits + b"\r\n")
