"""Where an output-error fit begins."""

from __future__ import annotations

import pytest

from identify.estimate.starting_point import horizon_s
from identify.signals.prepare import prepare
from tests.identify.simulated import TRUTH, sine_run


def test_the_horizon_is_three_periods_of_the_ring_or_the_time_constant_of_a_free_axis() -> None:
    traces = [prepare(sine_run(104, 3))]
    assert horizon_s(TRUTH, traces) == pytest.approx(3.0 / 29.3, rel=0.01)
    assert horizon_s((0.02, 0.04, 0.0), traces) == pytest.approx(0.5)
    assert horizon_s((0.02, 0.0, 0.0), traces) == pytest.approx(1.0)
    assert horizon_s((1e-9, 0.0, 677.3), traces) == pytest.approx(0.04), "never shorter than forty samples"
