"""The worked example of docs/devices/new-gyroscope.md does what the page says."""

import math
import re
import sys
import types
from pathlib import Path

import pytest

from drivers import gyroscopes
from rig.config.bench import GyroscopeConfig

PAGE = Path(__file__).parents[3] / "docs" / "devices" / "new-gyroscope.md"
FILE, LINE = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.fixture
def gyro(monkeypatch):
    name, path = re.search(r'"(\w+)": "([\w.:]+)"', LINE).groups()
    module = types.ModuleType(path.partition(":")[0])
    exec(FILE, module.__dict__)  # the page is ours, and this is the point of it
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(gyroscopes.DRIVERS, name, path)
    return gyroscopes.make_gyroscope(GyroscopeConfig(device=name))


def line(number, rate_deg_s, error=0):
    body = f"{number:05d},{rate_deg_s:+08.3f},{error}".encode()
    checksum = 0
    for byte in body:
        checksum ^= byte
    return b"#" + body + b"*%02X\n" % checksum


def test_example_is_under_60_lines():
    assert len(FILE.splitlines()) + len(LINE.splitlines()) < 60


def test_example_reads_rates_and_marks_lost_invalid_and_damaged_lines(gyro):
    samples = []
    for k in (99_998, 99_999, 0, 3):
        samples += gyro.feed(b"junk" + line(k, 12.345, error=int(k == 0)), 10.0 + (k + 2) % 100_000 / 500)
    assert [s.valid for s in samples] == [True, True, False, False, False, True]
    assert math.degrees(samples[0].rate_rad_s) == pytest.approx(12.345)
    assert samples[-1].time_s == pytest.approx(10.0 + 5 / 500 - 4.5e-3, abs=1e-3)
    assert gyro.counts.lost == 2
    damaged = bytearray(line(4, 12.345))
    damaged[3] ^= 1
    assert gyro.feed(bytes(damaged), 10.02) == []
    assert gyro.framer.dropped["checksum wrong"] == len(damaged)
