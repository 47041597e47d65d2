"""How noisy a channel is, and whether what was read there is noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from identify.signals.noise import is_white, noise_of

N = 8_000
MOTION = np.sin(0.02 * np.arange(N)) + 0.3 * np.sin(0.11 * np.arange(N))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("samples", [300, N])
def test_white_noise_below_a_motion_is_white_whatever_its_seed(seed: int, samples: int) -> None:
    read = (MOTION + 1e-3 * np.random.default_rng(seed).standard_normal(N))[:samples]
    assert is_white(read)
    assert noise_of(read) == pytest.approx(1e-3, rel=0.05 if samples == N else 0.25)


def test_the_steps_of_an_encoder_are_white() -> None:
    assert is_white(1e-3 * np.round(MOTION / 1e-3))


def test_motion_that_reaches_to_the_end_of_the_spectrum_is_not() -> None:
    shaken = signal.lfilter(*signal.butter(2, 0.3), np.random.default_rng(1).standard_normal(N))
    assert not is_white(MOTION + 0.01 * shaken)


def test_a_few_samples_tell_nothing_and_pass() -> None:
    assert is_white(np.arange(20.0))
