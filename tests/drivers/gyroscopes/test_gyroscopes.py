import itertools
import math

import pytest

from drivers.codecs import kvh1750, stim300, stim300_special, vectornav
from drivers.gyroscopes import make_gyroscope
from rig.config.bench import GyroscopeConfig
from rig.errors import ConfigError
from tests.drivers.wire import WIRE, needs_captures


def stim(rate_hz=2000.0, **settings):
    return make_gyroscope(GyroscopeConfig(sample_rate_hz=rate_hz, settings={"datagram": 0x90, **settings}))


def datagram(counter, rate_deg_s=10.0, status=0):
    word = round(rate_deg_s / stim300.RATE_LSB_DEG_S)
    return stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, word), status, counter & 255, 506))


def play(gyro, counters, start_s=50.0, rate_hz=2000.0):
    """Each datagram read by itself, in time."""
    out = []
    for k, counter in enumerate(counters):
        out += gyro.feed(datagram(counter), start_s + k / rate_hz)
    return out


@needs_captures
def test_real_start_up_log_gives_every_sample_and_marks_the_bad_ones():
    gyro = stim(datagram=0x93, line_ending=True, filter_hz=262)
    raw = (WIRE / "stim300_ubc_2000hz.bin").read_bytes()
    samples = []
    for k, at in enumerate(range(0, len(raw), 80)):
        samples += gyro.feed(raw[at : at + 80], 7.0 + k * 1e-3)
    assert (gyro.counts.received, gyro.counts.invalid, gyro.counts.lost) == (8392, 562, 0)
    assert "start-up" in gyro.counts.last_reason
    assert all(abs(math.degrees(s.rate_rad_s)) < 400 for s in samples if s.valid)
    steps = [b.time_s - a.time_s for a, b in itertools.pairwise(samples[4000:])]
    assert min(steps) > 0.49e-3
    assert max(steps) < 0.51e-3


def test_sample_is_stamped_before_its_arrival_by_wire_time_latency_and_group_delay():
    gyro = stim()
    samples = play(gyro, range(6000))
    on_wire_s = 18 * 10 / 921_600
    expected = 50.0 + 5999 / 2000 - on_wire_s - 506e-6 - 2.2e-3
    assert samples[-1].time_s == pytest.approx(expected, abs=1e-9)
    assert gyro.describe_delays() == (
        "gyro group delay 2.2 ms",
        "gyro latency by its packets 0.506 ms",
        "gyro packet transmission 0.195 ms",
    )
    assert math.degrees(samples[-1].rate_rad_s) == pytest.approx(10.0)


def test_two_datagrams_of_one_read_are_half_a_millisecond_apart():
    gyro = stim()
    play(gyro, range(4000))
    first, second = gyro.feed(datagram(4000) + datagram(4001), 50.0 + 4001 / 2000)
    assert second.time_s - first.time_s == pytest.approx(0.5e-3)


def test_lost_datagrams_are_marked_and_not_filled():
    samples = play(stim(), [0, 1, 2, 6, 7])
    assert [s.valid for s in samples] == [True, True, True, False, False, False, True, True]
    assert all(math.isnan(s.rate_rad_s) for s in samples if not s.valid)


def test_gap_longer_than_the_counter_is_seen_by_the_clock():
    gyro = stim()
    play(gyro, range(4000))
    late = play(gyro, range(4300, 4400), start_s=50.0 + 4300 / 2000)
    assert gyro.counts.lost == 300
    assert late[-1].time_s == pytest.approx(50.0 + 4399 / 2000 - 180 / 921_600 - 506e-6 - 2.2e-3, abs=2e-6)


def test_datagrams_that_were_held_up_and_catch_up_are_not_taken_for_lost():
    gyro = stim()
    play(gyro, range(4000))
    resumed_s = 50.0 + 4300 / 2000
    for k in range(0, 320, 10):  # in pieces, as a kernel hands them out that was busy with something else
        gyro.feed(b"".join(datagram(4000 + k + i) for i in range(10)), resumed_s + k * 20e-6)
    late = play(gyro, range(4320, 4400), start_s=50.0 + 4320 / 2000)
    assert gyro.counts.lost == 0
    assert late[-1].time_s == pytest.approx(50.0 + 4399 / 2000 - 180 / 921_600 - 506e-6 - 2.2e-3, abs=2e-6)


def test_answer_takes_the_place_of_a_sample_which_is_then_not_lost():
    gyro = stim()
    play(gyro, range(3))
    gyro.feed(stim300_special.encode_serial_number("N25581846020021"), 50.0015)
    gyro.feed(datagram(4), 50.002)
    assert gyro.counts.lost == 0
    assert gyro.messages == ["serial number N25581846020021"]


def test_clipped_and_flagged_samples_are_invalid_with_the_reason():
    gyro = stim()
    assert [s.valid for s in gyro.feed(datagram(0, 410.0), 1.0)] == [False]
    assert "beyond the full scale" in gyro.counts.last_reason
    assert [s.valid for s in gyro.feed(datagram(1, 10.0, status=0b0010_0000), 1.0005)] == [False]
    assert gyro.counts.last_reason == "status byte: outside operating conditions"


def test_incremental_angle_is_a_mean_rate_half_a_sample_older():
    rate, increment = stim(), stim(output="incremental_angle")
    assert increment.delay_s - rate.delay_s == pytest.approx(0.25e-3)
    word = round(10.0 / 2000 / stim300.INCREMENT_LSB_DEG)
    raw = stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, word), 0, 1, 506))
    [sample] = increment.feed(raw, 1.0)
    assert math.degrees(sample.rate_rad_s) == pytest.approx(10.0, abs=1e-3)


def test_other_datagram_on_the_wire_is_named_with_the_cure():
    raw = b"".join(stim300.encode_datagram(stim300.Datagram(0x93, (1, 2, 3), 0, k, 506), True) for k in range(5))
    gyro = stim()
    assert gyro.feed(raw, 1.0) == []
    assert "set bench.gyroscope.settings.datagram: 0x93 and line_ending: true" in gyro.explain_silence(raw)


def test_device_set_otherwise_than_the_file_is_objected_to():
    gyro = stim()
    configuration = stim300_special.Stim300Configuration(
        "-", 1, 1000, 0x90, False, 921_600, "angular_rate", (262, 262, 33), (10, 10, 10)
    )
    gyro.feed(stim300_special.encode_configuration(configuration), 1.0)
    assert gyro.objections() == [
        "bench.gyroscope.sample_rate_hz is 2000.0, the device is set to 1000",
        "bench.gyroscope.settings.filter_hz is 262, the device is set to 33",
    ]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"device": "stim3000"}, "there are stim300, vectornav, kvh1750"),
        ({"settings": {"filter": 262}}, "did you mean filter_hz"),
        ({"settings": {"filter_hz": 100}}, "filter_hz: 100 is not allowed"),
        ({"sample_rate_hz": 1500.0}, "1500 is not one of the STIM300's"),
        ({"baud": 460_800, "settings": {"datagram": 0x93}}, "need 760000 baud, the line has 460800"),
        ({"settings": {"datagram": 0x12}}, "0x12 is not one of the STIM300's"),
    ],
)
def test_settings_that_cannot_work_are_refused(config, message):
    with pytest.raises(ConfigError, match=message):
        make_gyroscope(GyroscopeConfig(**config))


def test_vectornav_binary_carries_its_own_time():
    gyro = make_gyroscope(GyroscopeConfig(device="vectornav", sample_rate_hz=400.0, axis="x"))
    samples = []
    for k in (*range(800), *range(803, 1600)):
        packet = vectornav.encode_binary_rate(round(k / 400 * 1e9), (0.25, 0.0, 0.0))
        samples += gyro.feed(packet, 9.0 + k / 400)
    assert gyro.counts.lost == 3
    assert samples[-1].time_s == pytest.approx(9.0 + 1599 / 400 - len(packet) * 10 / 921_600, abs=1e-9)
    assert samples[-1].rate_rad_s == 0.25


def test_vectornav_error_line_is_said():
    gyro = make_gyroscope(GyroscopeConfig(device="vectornav"))
    gyro.feed(vectornav.encode_line("ERR", "12"), 1.0)
    assert gyro.messages == ["insufficient baud rate for this output"]


def test_kvh_increments_become_rates_and_invalid_axes_are_marked():
    gyro = make_gyroscope(GyroscopeConfig(device="kvh1750", sample_rate_hz=1000.0, axis="y", invert=True))
    rates = []
    for k, status in ((0, 0x77), (1, 0x75)):
        message = kvh1750.KvhMessage("A", (0.0, 2e-3, 0.0), (0, 0, 1), status, k, 25)
        rates += gyro.feed(kvh1750.encode_kvh(message), 1.0 + k * 1e-3)
    assert rates[0].rate_rad_s == pytest.approx(-2.0)
    assert [s.valid for s in rates] == [True, False]


def test_a_datagram_that_comes_twice_is_one_sample_and_no_turn_of_the_counter():
    gyro = stim()
    samples = []
    for k in range(2000):
        packet = datagram(k % 256, 10.0 + 0.01 * (k % 7))
        samples += gyro.feed(packet + packet, 50.0 + k / 2000)
    assert len(samples) == 2000
    steps = [b.time_s - a.time_s for a, b in itertools.pairwise(samples[1000:])]
    assert max(steps) == pytest.approx(0.5e-3, rel=0.05)
    assert gyro.counts.repeated == 2000
