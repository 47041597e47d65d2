"""Spectral lines from outside, and those that the rig makes itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.signals.prepare import prepare
from identify.signals.spectral_lines import foreign_lines_hz, played_hz, ringing_hz, rings_hz
from identify.signals.trace import Trace
from rig.recording.run import Array
from tests.identify.simulated import NOISE_RAD_S, sine_run, white


def trace() -> Trace:
    return prepare(sine_run(104, 3), 0, NOISE_RAD_S)


def lines(residual: Array) -> tuple[float, ...]:
    return foreign_lines_hz([trace()], [residual], NOISE_RAD_S, 29.3)


def hum(frequency_hz: float, size: float = 1.0) -> Array:
    time = np.arange(4001) * 1e-3
    return size * NOISE_RAD_S * np.sin(2 * np.pi * frequency_hz * time) + white(len(time), NOISE_RAD_S)


def test_a_hum_below_the_noise_is_found_to_a_hundredth_of_a_hertz_or_two() -> None:
    assert lines(hum(13.37))[0] == pytest.approx(13.37, abs=0.03)


def test_noise_alone_has_no_line() -> None:
    assert lines(white(4001, NOISE_RAD_S)) == ()


@pytest.mark.parametrize("frequency_hz", [3.0, 9.0, 27.0])
def test_harmonics_of_the_torque_come_from_inside(frequency_hz: float) -> None:
    assert lines(hum(frequency_hz)) == ()


def test_a_line_at_the_natural_frequency_is_the_platforms_own_ring() -> None:
    assert lines(hum(29.0)) == ()


def test_the_frequency_of_a_torque_is_read_from_it_where_it_is_one_tone() -> None:
    nameless = replace(trace(), run=replace(trace().run, frequency_hz=None))
    assert played_hz(nameless) == pytest.approx(3.0, abs=0.05)
    assert played_hz(replace(nameless, torque=None)) is None


def test_a_tone_that_passes_for_the_resonance_is_read_where_it_is() -> None:
    loud = replace(trace(), measured=trace().measured + hum(45.3, 500.0))
    assert ringing_hz([trace(), loud], 45.0) == pytest.approx(45.3, abs=0.02)
    assert ringing_hz([trace()], 0.0) == 0.0


def test_what_rings_where_a_run_begins_is_found_though_no_line_of_the_whole_run_shows_it() -> None:
    time = np.arange(4001) * 1e-3
    ring = 4.0 * NOISE_RAD_S * np.exp(-8.0 * time) * np.sin(2.0 * np.pi * 85.5 * time)
    found = rings_hz([trace()], [ring + white(len(time), NOISE_RAD_S)], 29.3)
    assert found[0] == pytest.approx(85.5, abs=0.7)
    assert all(abs(f - 29.3) > 3.9 for f in rings_hz([trace()], [hum(29.3, 3.0)], 29.3))
    assert all(abs(f - 29.3) < 3.9 for f in rings_hz([trace()], [hum(29.3, 3.0)], 60.0)[:1])
