"""The low-pass before a decimation: it leaves the motion as it is, and white noise white."""

from __future__ import annotations

import numpy as np
import pytest

from rig.decimation import keeps_white


@pytest.mark.parametrize("factor", [2, 3, 8, 40])
def test_white_noise_is_white_again_with_the_variance_of_a_mean(factor: int) -> None:
    weights = keeps_white(factor)
    covariance = np.convolve(weights, weights[::-1])[len(weights) - 1 :: factor]
    assert covariance[0] == pytest.approx(1.0 / factor, rel=1e-3)
    assert np.max(np.abs(covariance[1:])) < 1e-4 * covariance[0]


@pytest.mark.parametrize("factor", [2, 3, 8, 40])
def test_it_is_flat_where_a_platform_moves_and_zero_beyond_the_aliases(factor: int) -> None:
    passed = np.abs(np.fft.rfft(keeps_white(factor), 1 << 16))
    of_nyquist = 2.0 * factor * np.fft.rfftfreq(1 << 16)
    assert np.max(np.abs(passed[of_nyquist < 0.6] - 1.0)) < 1e-4
    assert np.all(passed[of_nyquist > 1.4] < 1e-4)
