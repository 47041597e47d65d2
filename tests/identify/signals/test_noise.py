"""How noisy a channel is, and whether what was read there is noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from identify.signals.noise import is_noise, noise_of

N = 8_000
MOTION = np.sin(0.02 * np.arange(N)) + 0.3 * np.sin(0.11 * np.arange(N))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("samples", [300, N])
def test_white_noise_below_a_motion_is_noise_whatever_its_seed(seed: int, samples: int) -> None:
    read = (MOTION + 1e-3 * np.random.default_rng(seed).standard_normal(N))[:samples]
    assert is_noise(read)
    assert noise_of(read) == pytest.approx(1e-3, rel=0.05 if samples == N else 0.25)


def test_the_steps_of_an_encoder_are_noise() -> None:
    assert is_noise(1e-3 * np.round(MOTION / 1e-3))


def test_noise_behind_a_low_pass_is_noise() -> None:
    coloured = signal.lfilter(*signal.butter(2, 0.3), np.random.default_rng(1).standard_normal(N))
    assert is_noise(MOTION + 0.01 * coloured)


def test_motion_with_corners_that_reaches_to_the_end_of_the_spectrum_is_not() -> None:
    phase = 0.02 * np.arange(N)
    bent = np.cumsum(np.sign(np.sin(phase))) * 1e-2
    assert not is_noise(bent + 1e-6 * np.random.default_rng(1).standard_normal(N))


def test_a_few_samples_tell_nothing_and_pass() -> None:
    assert is_noise(np.arange(20.0))
