"""A long recording as a run: what is kept of motion, torque, flags and channels, and which span."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from rig.arrays import Array
from rig.decimation import REACH
from rig.recording.long.excerpt import Rows, Taken, take

STEP_S = 1e-4
FLAT = 1e-5  # of the low-pass, the same for torque and motion


def rows_of(columns: Mapping[str, Array]) -> Rows:
    return lambda first, last: {name: values[first:last] for name, values in columns.items()}


def recording(count: int = 400_000, noise: float = 1e-3, seed: int = 1) -> dict[str, Array]:
    """A platform that swings at 5 Hz, 10 kHz samples."""
    time = STEP_S * np.arange(count)
    rate = np.sin(2.0 * np.pi * 5.0 * time) + noise * np.random.default_rng(seed).standard_normal(count)
    return {"time": time, "valid": np.ones(count), "rate": rate, "torque": np.cos(2.0 * np.pi * 5.0 * time)}


def taken(columns: Mapping[str, Array], most: int, held: bool = False) -> Taken:
    return take(rows_of(columns), 0, len(columns["time"]), most, held=held)


def test_a_motion_far_below_the_sample_rate_is_decimated_to_the_samples_asked_for_and_nothing_is_cut() -> None:
    found = taken(recording(), 10_000)
    time, rate = found.columns["time"], found.columns["rate"]
    assert found.excerpt.whole and found.excerpt.samples == 400_000
    assert found.excerpt.factor == 40 and len(time) == 10_000 - 2 * REACH
    motion = np.sin(2.0 * np.pi * 5.0 * time)
    assert np.std(rate - motion) == pytest.approx(1e-3 / np.sqrt(40.0), rel=0.05)  # white noise, averaged
    np.testing.assert_allclose(found.columns["torque"], np.cos(2.0 * np.pi * 5.0 * time), atol=FLAT)


def test_the_decimated_noise_is_white() -> None:
    found = taken(recording(noise=0.5), 20_000)
    noise = found.columns["rate"] - np.sin(2.0 * np.pi * 5.0 * found.columns["time"])
    again = noise - noise.mean()
    for lag in (1, 2, 3, 5):
        assert abs(again[lag:] @ again[:-lag]) / (again @ again) < 4.0 / np.sqrt(len(again))


def test_a_fast_motion_is_not_decimated_below_eight_samples_a_period_but_cut() -> None:
    columns = recording()
    columns["rate"] += np.sin(2.0 * np.pi * 200.0 * columns["time"])
    found = taken(columns, 5000)
    assert 2 <= found.excerpt.factor <= int(1.0 / (8.0 * 200.0 * STEP_S))
    assert not found.excerpt.whole and 4900 <= len(found.columns["time"]) <= 5100


def test_the_span_that_is_kept_is_where_the_platform_moves() -> None:
    columns = recording(noise=1e-4)
    columns["rate"][:300_000] *= 1e-2
    columns["rate"] += 0.3 * np.sin(2.0 * np.pi * 100.0 * columns["time"]) * (columns["time"] > 30.0)
    found = taken(columns, 2000)
    assert found.excerpt.begin_s > 29.0


def test_a_held_torque_becomes_what_acts_about_each_new_instant() -> None:
    columns = recording()
    columns["torque"] = np.cos(2.0 * np.pi * 5.0 * (columns["time"] + 0.5 * STEP_S))  # what a step holds, on average
    found = taken(columns, 10_000, held=True)
    np.testing.assert_allclose(found.columns["torque"], np.cos(2.0 * np.pi * 5.0 * found.columns["time"]), atol=FLAT)


def test_a_lost_stretch_is_marked_and_nothing_beside_it() -> None:
    columns = recording(noise=0.1)
    columns["valid"][200_000:200_400] = 0.0
    columns["rate"][200_000:200_400] = np.nan
    found = taken(columns, 10_000)
    lost = found.columns["time"][found.columns["valid"] == 0.0]
    assert lost[0] == pytest.approx(20.0, abs=0.009) and lost[-1] == pytest.approx(20.04, abs=0.009)
    assert len(lost) <= 13


def test_a_channel_read_now_and_then_is_the_mean_of_its_readings_or_nothing() -> None:
    columns = recording()
    columns["channel motor"] = np.full(400_000, np.nan)
    columns["channel motor"][::4000] = 40.0 + columns["time"][::4000]
    found = taken(columns, 10_000).columns
    motor, time = found["channel motor"], found["time"]
    known = np.isfinite(motor)
    assert 90 <= known.sum() <= 110
    np.testing.assert_allclose(motor[known], 40.0 + time[known], atol=40 * STEP_S)


def test_stamps_without_a_beat_are_cut_and_kept_as_they_are() -> None:
    columns = recording(50_000)
    columns["time"] += 0.4 * STEP_S * np.random.default_rng(3).standard_normal(50_000)
    columns["time"].sort()
    found = taken(columns, 5000)
    assert found.excerpt.factor == 1 and len(found.columns["time"]) == 5000
    assert set(found.columns["rate"]) <= set(columns["rate"])
