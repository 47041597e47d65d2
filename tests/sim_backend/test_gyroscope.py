"""The simulated gyroscope does what its data sheet says, and stamps samples at their true instant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.config.simulated import SimulatedGyro
from rig.interface import GyroSample
from sim_backend.gyroscope import Gyroscope, group_delay_s

STEP_S = 1.25e-4
EVERY = 8


def sensed(config: SimulatedGyro, rate_rad_s: np.ndarray, seed: int = 1, index: int = 1) -> list[GyroSample]:
    gyro = Gyroscope(config, STEP_S, EVERY, seed)
    gyro.restart(index)
    samples: list[GyroSample] = []
    for first in range(0, len(rate_rad_s), EVERY):
        block = rate_rad_s[first : first + EVERY]
        samples += gyro.sense(block, first, len(block), (first + len(block)) * STEP_S)
    return samples


def rates(samples: list[GyroSample]) -> np.ndarray:
    return np.array([s.rate_rad_s for s in samples])


def test_noise_and_bias_are_those_of_the_data_sheet() -> None:
    reading = np.degrees(rates(sensed(SimulatedGyro(noise_deg_s=0.05, bias_deg_s=0.3), np.zeros(EVERY * 20_000))))
    assert reading.mean() == pytest.approx(0.3, abs=0.002)
    assert reading.std() == pytest.approx(0.05, rel=0.02)
    white = np.corrcoef(reading[1:], reading[:-1])[0, 1]
    assert abs(white) < 0.03


def test_streams_depend_on_seed_and_set_and_on_nothing_else() -> None:
    still, config = np.zeros(EVERY * 100), SimulatedGyro()
    assert (rates(sensed(config, still)) == rates(sensed(config, still))).all()
    assert (rates(sensed(config, still)) != rates(sensed(config, still, index=2))).all()
    assert (rates(sensed(config, still)) != rates(sensed(config, still, seed=2))).all()


def test_a_reading_is_a_whole_number_of_resolution_steps() -> None:
    config = SimulatedGyro(noise_deg_s=0.1, resolution_deg_s=0.02)
    steps = np.degrees(rates(sensed(config, np.zeros(EVERY * 200)))) / 0.02
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert len(np.unique(np.round(steps))) > 5


def test_beyond_full_scale_a_sample_is_clipped_and_invalid() -> None:
    rate = np.radians(np.repeat([399.0, -500.0], EVERY))
    good, clipped = sensed(SimulatedGyro(noise_deg_s=0, full_scale_deg_s=400), rate)
    assert good.valid
    assert not clipped.valid
    assert math.degrees(clipped.rate_rad_s) == pytest.approx(-400)


def test_without_a_filter_each_sample_is_the_rate_at_its_time_stamp() -> None:
    t = STEP_S * np.arange(1, EVERY * 100 + 1)
    samples = sensed(SimulatedGyro(noise_deg_s=0), np.sin(180 * t))
    stamps = np.array([s.time_s for s in samples])
    np.testing.assert_allclose(stamps, 1e-3 * np.arange(1, 101), atol=1e-12)
    np.testing.assert_allclose(rates(samples), np.sin(180 * stamps), atol=1e-12)


def test_a_delay_holds_samples_back_and_is_taken_off_their_stamps() -> None:
    gyro = Gyroscope(SimulatedGyro(noise_deg_s=0, delay_s=0.0025), STEP_S, EVERY, 1)
    ramp = STEP_S * np.arange(1, 5 * EVERY + 1)
    arrived = [gyro.sense(ramp[k * EVERY :], k * EVERY, EVERY, (k + 1) * 1e-3) for k in range(5)]
    assert [len(a) for a in arrived] == [0, 0, 0, 1, 1]
    assert arrived[3][0].time_s == pytest.approx(1e-3)
    assert arrived[3][0].rate_rad_s == pytest.approx(1e-3)


def test_a_delay_that_the_driver_does_not_know_of_stays_in_the_time_stamps() -> None:
    config = SimulatedGyro(noise_deg_s=0, delay_s=0.0025, corrected_delay_s=0.002)
    gyro = Gyroscope(config, STEP_S, EVERY, 1)
    sample = gyro.sense(STEP_S * np.arange(1, EVERY + 1), 0, EVERY, 1.0)[0]
    assert sample.time_s - sample.rate_rad_s == pytest.approx(0.0005)


def test_the_group_delay_of_the_bandwidth_is_taken_off_so_that_slow_motion_keeps_its_time() -> None:
    t = STEP_S * np.arange(1, EVERY * 2000 + 1)
    w = 2 * math.pi * 9
    samples = sensed(SimulatedGyro(noise_deg_s=0, bandwidth_hz=262), np.sin(w * t))[500:]
    stamps = np.array([s.time_s for s in samples])
    assert stamps[0] == pytest.approx(0.501 - group_delay_s(262))
    np.testing.assert_allclose(rates(samples), np.sin(w * stamps), atol=2e-4)


def test_at_its_bandwidth_the_gyro_reports_seventy_percent() -> None:
    t = STEP_S * np.arange(1, EVERY * 2000 + 1)
    samples = sensed(SimulatedGyro(noise_deg_s=0, bandwidth_hz=50), np.sin(2 * math.pi * 50 * t))
    assert np.abs(rates(samples[1000:])).max() == pytest.approx(1 / math.sqrt(2), rel=0.01)
