"""What was captured is played again through the same drivers, bit for bit."""

import math

import numpy as np
import pytest

from drivers.replay import ReplayRig
from rig.errors import RecordingError
from tests.drivers.wireless import play


def test_replay_gives_bit_identical_samples(bench, tmp_path):
    with bench.opened(), bench.armed():
        live = play(bench, 400)
    replay = ReplayRig(tmp_path / "raw" / "wire.cap")
    with replay.opened(), replay.armed():
        again = play(replay, 400)
    assert sum(len(e.gyro) for e in live) > 300
    assert sum(len(e.torque) for e in live) > 300
    for a, b in zip(live, again, strict=True):
        assert np.array_equal(np.array(a.gyro), np.array(b.gyro), equal_nan=True)
        assert a.torque == b.torque
        assert a.channels == b.channels
    with pytest.raises(RecordingError, match="was cut short"):
        replay.exchange(0.0, 0.0)
    assert replay.expected_delay == bench.expected_delay


def test_replay_stamps_its_sets_anew_exactly_as_the_bench_did(bench, tmp_path):
    def play_set(rig, start_s, ticks):
        rig.begin_set(lambda t: 0.0, start_s)
        for k in range(ticks):
            now_s = rig.clock.now_s()
            bench.time.now_s += 1e-3 if rig is bench else 0.0
            rig.exchange(now_s, math.sin(k / 20))
        rig.end_set()

    found = []
    for make in (lambda: bench, lambda: ReplayRig(tmp_path / "raw" / "wire.cap")):
        rig = make()
        with rig.opened(), rig.armed():
            play_set(rig, 3.0, 6000)
            play_set(rig, 9.5, 2000)
        found.append(rig.corrections())
    live, again = found
    assert len(live) == 2
    assert [len(one.samples[0]) > 10 and len(one.torque[0]) > 10 for one in live] == [True, True]
    assert live == again


def test_a_file_that_says_the_devices_were_otherwise_is_told_key_by_key(bench, tmp_path):
    with bench.opened(), bench.armed():
        play(bench, 20)
    replay = ReplayRig(tmp_path / "raw" / "wire.cap")
    assert replay.differences(replay.config) == []
    other = replay.config.model_copy(
        update={
            "gyroscope": replay.config.gyroscope.model_copy(
                update={"port": "/dev/ttyS9", "invert": True, "settings": {"filter_hz": 131}}
            )
        }
    )
    told = replay.differences(other)
    assert "bench.gyroscope.invert: True (the capture has False)" in told
    assert any(text.startswith("bench.gyroscope.settings.filter_hz: 131 ") for text in told)
    assert not any("port" in text for text in told)
