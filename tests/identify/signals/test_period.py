"""The period of a torque, found in its samples."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.period import period_of
from tests.identify.simulated import white

TIME = np.arange(10_001) * 1e-3


@pytest.mark.parametrize("hertz", [0.5, 3.0, 7.3, 31.0, 123.4])
def test_a_sine_repeats_between_its_samples(hertz: float) -> None:
    assert period_of(np.sin(2 * np.pi * hertz * TIME), 1e-3) == pytest.approx(1.0 / hertz, rel=2e-4)


def test_noise_on_the_torque_does_not_hide_the_period() -> None:
    values = np.sin(2 * np.pi * 3.0 * TIME) + white(len(TIME), 0.02)
    assert period_of(values, 1e-3) == pytest.approx(1.0 / 3.0, rel=1e-3)


def test_a_sum_of_sines_repeats_with_the_period_common_to_all() -> None:
    values = sum(np.sin(2 * np.pi * hertz * TIME + hertz) for hertz in (1.0, 2.5, 4.0))
    assert period_of(np.asarray(values), 1e-3) == pytest.approx(2.0, rel=1e-4)


def test_two_close_sines_have_no_shorter_period_than_their_beat_allows() -> None:
    values = np.sin(2 * np.pi * 5.0 * TIME) + np.sin(2 * np.pi * 5.07 * TIME)
    assert period_of(values, 1e-3) is None


@pytest.mark.parametrize(
    "values", [white(10_001), TIME, np.ones(10_001), np.sin(2 * np.pi * 0.3 * TIME**2)],
    ids=["noise", "ramp", "constant", "sweep"],
)  # fmt: skip
def test_what_does_not_repeat_has_no_period(values: np.ndarray) -> None:
    assert period_of(values, 1e-3) is None
