"""Runs whose sensor was noisier than in the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from identify.runs.noisy import describe_noisy_runs, noisy_runs
from rig.config.identify import IdentifyConfig
from rig.recording.run import Array, Recording
from tests.identify.simulated import DECLARED, NOISE_RAD_S, SETS, campaign, sine_run, traces_of, white


def with_noise(*times: float) -> Recording:
    return Recording(tuple(sine_run(m, f, noise=NOISE_RAD_S * x) for (m, f), x in zip(SETS, times, strict=True)))


@pytest.mark.parametrize(
    ("times", "noisy"),
    [
        ((1.0, 1.0, 1.0, 1.0, 1.0), []),
        ((1.0, 3.0, 1.0, 1.0, 1.0), [1]),
        ((1.0, 1.0, 2.0, 1.0, 5.0), [2, 4]),
        ((1.0, 1.1, 1.0, 1.0, 1.0), []),
        ((1.0, 1.0, 3.0, 3.0, 3.0), []),  # most of them: that is the sensor
    ],
)
def test_the_noisier_runs_are_found_where_most_agree(times: tuple[float, ...], noisy: list[int]) -> None:
    assert [t.number for t, _ in noisy_runs(traces_of(with_noise(*times)))] == noisy


def test_a_run_that_rings_high_up_is_no_noisier_one() -> None:
    recording = campaign()
    run = recording.runs[2]
    rate = run.rate_rad_s
    assert rate is not None
    high = 10.0 * NOISE_RAD_S * _between(300.0, 350.0, len(rate))
    runs = tuple(replace(r, rate_rad_s=rate + high) if r is run else r for r in recording.runs)
    assert noisy_runs(traces_of(Recording(runs))) == []


def _between(low_hz: float, high_hz: float, n: int) -> Array:
    spectrum = np.fft.rfft(white(n, seed=7))
    f = np.fft.rfftfreq(n, 1e-3)
    return np.fft.irfft(np.where((f > low_hz) & (f < high_hz), spectrum, 0.0), n)


@pytest.mark.slow
def test_a_clean_campaign_with_a_noisy_run_is_accepted_without_it_and_says_so() -> None:
    found = identify(with_noise(1.0, 1.0, 4.0, 1.0, 1.0), DECLARED, IdentifyConfig())
    assert found.accepted
    assert not found.verdict.effects
    assert "Excluded as too noisy: 3 Hz (4.0 times the noise of the other runs)" in found.holdout_note


def test_nothing_is_told_where_nothing_was_left_out() -> None:
    assert describe_noisy_runs([]) == ""
