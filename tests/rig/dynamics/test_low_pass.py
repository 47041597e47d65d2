"""The gyro's own low-pass: right at its corner, flat below, and nothing moved in time."""

from __future__ import annotations

import numpy as np
import pytest

from rig.dynamics.low_pass import low_pass_kernel, smoothed


@pytest.mark.parametrize(("corner_hz", "delay_s"), [(262.0, 2.2e-3), (131.0, 3.7e-3), (66.0, 6.7e-3)])
@pytest.mark.parametrize("step_s", [1e-4, 2.5e-4])
@pytest.mark.parametrize("averaged_steps", [0, 2])
def test_the_corner_is_where_the_data_sheet_has_it_and_the_pass_band_is_flat(
    corner_hz: float, delay_s: float, step_s: float, averaged_steps: int
) -> None:
    averaged_s = averaged_steps * step_s
    kernel = low_pass_kernel(corner_hz, delay_s, step_s, averaged_s)
    t = step_s * np.arange(-(len(kernel) // 2), len(kernel) // 2 + 1)

    def gain(frequency_hz: float) -> float:
        return float(np.sum(kernel * np.cos(2 * np.pi * frequency_hz * t)) * np.sinc(frequency_hz * averaged_s))

    assert gain(0.0) == pytest.approx(1.0)
    assert gain(corner_hz) == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert gain(0.1 * corner_hz) == pytest.approx(1.0, abs=2e-4 if corner_hz == 262.0 else 6e-3)
    assert np.array_equal(kernel, kernel[::-1]) or np.allclose(kernel, kernel[::-1], rtol=1e-12)


def test_a_slow_rate_passes_unchanged_and_a_corner_is_rounded() -> None:
    t = np.arange(-0.1, 0.1, 1e-4)
    kernel = low_pass_kernel(262.0, 2.2e-3, 1e-4)
    slow, corner = np.sin(2 * np.pi * 9 * t), np.abs(t)
    assert np.max(np.abs(smoothed(slow, kernel) - slow)[50:-50]) < 1e-5
    rounded = smoothed(corner, kernel)
    assert rounded[1000] > 1e-4
    assert np.max(np.abs(rounded - corner)[50:970]) < 1e-9


def test_a_step_longer_than_the_delay_leaves_everything_as_it_is() -> None:
    assert np.array_equal(smoothed(np.arange(5.0), low_pass_kernel(262.0, 2.2e-3, 0.01)), np.arange(5.0))
