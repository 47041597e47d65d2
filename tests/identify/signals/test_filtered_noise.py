"""How much of the noise ahead of a low-pass shows where the noise of a channel is read off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from identify.signals.filtered_noise import filtered_density
from rig.decimation import NOISE_BAND

STEP_S = 4e-3


@pytest.mark.parametrize("lag", [(3.5e-3, 0.5 * 3.5e-3**2), (1e-3, 0.5 * 1e-3**2), (2e-3, 0.0), (2e-4, 0.0)])
def test_the_end_of_the_spectrum_of_filtered_noise_is_as_high_as_it_says(lag: tuple[float, float]) -> None:
    fine = 40
    first, second = lag
    denominator = [second, first, 1.0] if second else [first, 1.0]
    b, a = signal.bilinear([1.0], denominator, fs=fine / STEP_S)
    noise = signal.lfilter(b, a, np.random.default_rng(1).standard_normal(60_000 * fine))
    samples = noise[1000 * fine :: fine] / np.std(noise)
    f, density = signal.welch(samples, fs=2.0, nperseg=256)  # of Nyquist, one-sided: of white noise its variance
    inside = (f > NOISE_BAND[0]) & (f < NOISE_BAND[1])
    assert filtered_density(lag, STEP_S) == pytest.approx(np.mean(density[inside]), rel=0.04)


def test_behind_a_quick_low_pass_noise_is_white() -> None:
    assert filtered_density((1e-6, 0.5e-12), STEP_S) == pytest.approx(1.0, abs=1e-6)
