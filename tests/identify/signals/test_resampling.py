"""Samples on an even beat: moved there along the motion where they scatter, and taken as they are where stamps do."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.noise import noise_of
from identify.signals.prepare import prepare
from identify.signals.resampling import beat_of, describe, sampled
from rig.errors import RecordingError
from rig.recording.run import Array, Run
from tests.identify.simulated import NOISE_RAD_S

STEP_S = 1e-3
EVEN = STEP_S * np.arange(8001)


def ring(time: Array) -> Array:
    return 5.0 * np.sin(2 * np.pi * 29 * time) + 2.0 * np.sin(2 * np.pi * 3 * time)


def scattered(by_s: float, seed: int = 1) -> Array:
    time = np.sort(EVEN + by_s * np.random.default_rng(seed).standard_normal(len(EVEN)))
    return np.asarray(time - time[0])


def white(n: int, seed: int = 7) -> Array:
    return NOISE_RAD_S * np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("by_s", [1e-5, 5e-5, 1e-4, 2e-4])
def test_scattered_samples_keep_their_noise_and_follow_the_motion(by_s: float) -> None:
    time = scattered(by_s)
    found = sampled(beat_of("x", time), time, ring(time) + white(len(time)), np.ones(len(time), bool))
    error = (found.values - ring(found.beat.instants))[20:-20]
    assert found.scatter_s == pytest.approx(by_s, rel=0.1)
    assert not found.stamps_wrong
    assert np.std(error) == pytest.approx(NOISE_RAD_S, rel=0.03)
    assert noise_of(found.values) == pytest.approx(NOISE_RAD_S, rel=0.03)


def test_without_noise_they_follow_it_to_two_parts_in_a_million() -> None:
    time = scattered(1e-4)
    found = sampled(beat_of("x", time), time, ring(time), np.ones(len(time), bool))
    assert np.max(np.abs(found.values - ring(found.beat.instants))[20:-20]) < 1.4e-5


def test_where_only_the_stamps_scatter_the_samples_are_taken_as_even() -> None:
    time, values = scattered(5e-5), ring(EVEN) + white(len(EVEN))
    found = sampled(beat_of("x", time), time, values, np.ones(len(time), bool))
    assert found.stamps_wrong
    np.testing.assert_array_equal(found.values, values)
    assert "a jitter of up to 49.9 us" in describe([("x", found.scatter_s, True), ("y", 1.0, False)])
    assert describe([("x", 1e-4, False)]) == ""


def test_samples_that_are_missing_among_scattered_ones_are_bridged_and_do_not_count() -> None:
    time = scattered(1e-4)
    there = np.ones(len(time), bool)
    there[[100, 2000, 2001, 5000]] = False
    found = sampled(beat_of("x", time[there]), time[there], ring(time[there]), np.ones(there.sum(), bool))
    assert found.beat.count == len(EVEN)
    assert not found.there[[100, 2000, 2001, 5000]].any()
    assert found.there.sum() == there.sum()
    assert np.max(np.abs(found.values - ring(found.beat.instants))[20:-20]) < 0.02


def test_exact_stamps_stay_as_they_are() -> None:
    beat = beat_of("x", EVEN)
    assert (beat.step_s, beat.offset_s, beat.scattered) == (pytest.approx(STEP_S), 0.0, False)


def test_random_instants_have_no_beat_and_are_laid_on_their_median_spacing() -> None:
    time = np.sort(np.random.default_rng(5).uniform(0.0, 8.0, 8000))
    time -= time[0]
    beat = beat_of("x", time)
    assert not beat.scattered
    assert beat.step_s == pytest.approx(np.median(np.diff(time)))


def test_a_hole_of_hours_is_refused_with_the_place_to_cut() -> None:
    with pytest.raises(RecordingError, match="split it into two runs"):
        beat_of("x", np.concatenate([EVEN, 3600.0 + EVEN]))


def test_what_a_gyro_reads_at_rest_is_taken_off_where_an_encoder_shows_it() -> None:
    rng, bias = np.random.default_rng(4), 3e-3
    angle = 0.1 * np.sin(2 * np.pi * 3 * EVEN) + 1e-5 * rng.standard_normal(len(EVEN))
    rate = 0.6 * np.pi * np.cos(2 * np.pi * 3 * EVEN) + bias + white(len(EVEN))
    valid = np.ones(len(EVEN), bool)
    valid[4000:4100] = False  # what was turned in a hole the gyro has not seen
    trace = prepare(Run("x", EVEN, valid, rate_rad_s=rate, angle_rad=angle))
    assert trace.channel == "rate"
    assert np.mean((trace.measured - (rate - bias))[valid]) == pytest.approx(0.0, abs=3e-5)
