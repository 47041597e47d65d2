"""What a gyroscope's first seconds tell: too few samples, a line too slow, an axis that shows nothing."""

import math

import pytest

from drivers.codecs import stim300, vectornav
from drivers.gyroscopes import make_gyroscope
from drivers.gyroscopes.gyro_line import GyroLine
from rig.config.bench import GyroscopeConfig
from rig.errors import ConfigError


class NoPort:
    name = "wire"


def vectornav_line(**config):
    return GyroLine(make_gyroscope(GyroscopeConfig(device="vectornav", axis="x", **config)), NoPort(), None)


def ascii_rate(k):
    return vectornav.encode_line("GYR", f"{0.01 * math.sin(k):+010.6f}", "+00.000000", "+00.000000")


def listen(line, packet, rate_hz, for_s=3.0, lost=lambda k: False, stall=None):
    for k in range(round(for_s * rate_hz)):
        at_s = 10.0 + k / rate_hz
        if stall is not None and stall[0] <= k / rate_hz < stall[1]:
            at_s = 10.0 + stall[1]
        if not lost(k):
            line.feed(packet(k), at_s)
    return line.problems(for_s)


def test_a_gyro_that_sends_what_the_file_says_has_no_problems():
    assert listen(vectornav_line(sample_rate_hz=400), ascii_rate, 400.0) == []


def test_a_fifth_of_the_samples_lost_is_said_with_the_cure_although_ascii_lines_carry_no_counter():
    (said,) = listen(vectornav_line(sample_rate_hz=400), ascii_rate, 400.0, lost=lambda k: k % 5 == 0)
    assert "320 samples/s instead of 400" in said
    assert "set bench.gyroscope.sample_rate_hz" in said
    assert "the line or the adapter loses samples" in said


def test_a_device_that_sends_more_than_the_file_says_is_told_too():
    (said,) = listen(vectornav_line(sample_rate_hz=100), ascii_rate, 200.0)
    assert "200 samples/s instead of 100" in said


def test_a_counter_says_how_many_were_lost_on_the_way():
    def packet(k):
        word = round(math.sin(k) / stim300.RATE_LSB_DEG_S)
        return stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, word), 0, k & 255, 506))

    line = GyroLine(make_gyroscope(GyroscopeConfig(settings={"datagram": 0x90})), NoPort(), None)
    (said,) = listen(line, packet, 2000.0, lost=lambda k: k % 5 == 0)
    assert "1600 samples/s instead of 2000; its counter shows that 11" in said


def test_a_computer_that_stalls_once_is_no_fault_of_the_gyro():
    assert listen(vectornav_line(sample_rate_hz=400), ascii_rate, 400.0, stall=(1.0, 1.4)) == []
    assert listen(vectornav_line(sample_rate_hz=400), ascii_rate, 400.0, stall=(2.5, 3.4)) == []


def test_a_line_too_slow_for_what_the_device_really_sends_is_told():
    (said,) = listen(vectornav_line(sample_rate_hz=400, baud=115_200), ascii_rate, 400.0)
    bytes_each = len(ascii_rate(0))
    assert f"{bytes_each} bytes 400 times a second need {bytes_each * 4000} baud, the line has 115200" in said
    assert "send shorter packets" in said


@pytest.mark.parametrize(
    ("config", "needed"),
    [
        ({"device": "vectornav", "sample_rate_hz": 800, "baud": 115_200}, "18 bytes 800 times a second need 144000"),
        ({"device": "kvh1750", "sample_rate_hz": 5000}, "36 bytes 5000 times a second need 1800000"),
    ],
)
def test_a_line_too_slow_for_the_shortest_packets_is_refused_before_it_is_opened(config, needed):
    with pytest.raises(ConfigError, match=f"bench.gyroscope.baud: {needed} baud"):
        make_gyroscope(GyroscopeConfig(**config))


def test_an_axis_without_any_noise_is_told():
    line = vectornav_line(sample_rate_hz=400)
    (said,) = listen(line, lambda k: vectornav.encode_line("GYR", "+00.000000", "+00.001000", "+00.001000"), 400.0)
    assert "all of 1200 samples read exactly 0 deg/s" in said
    assert "bench.gyroscope.axis" in said
