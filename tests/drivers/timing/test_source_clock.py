import numpy as np
import pytest

from drivers.timing.source_clock import SourceClock

PERIOD_S = 0.5e-3


@pytest.mark.parametrize("drift_ppm", [-40.0, 0.0, 25.0])
def test_time_is_that_of_the_source_however_late_the_reads_are(drift_ppm):
    rng = np.random.default_rng(3)
    clock = SourceClock(PERIOD_S)
    n = np.arange(20_000)
    true_s = 100.0 + n * PERIOD_S * (1.0 + drift_ppm * 1e-6)
    for count, late_s in zip(n.tolist(), rng.exponential(100e-6, len(n)), strict=True):
        clock.observe(count, true_s[count] + late_s)
    error_s = [clock.host_time_s(int(k)) - true_s[k] for k in n[-4000:]]
    assert np.max(np.abs(error_s)) < 2e-6
    assert clock.drift_ppm == pytest.approx(drift_ppm, abs=0.5)


def test_half_a_second_of_late_reads_moves_no_sample():
    clock = SourceClock(PERIOD_S)
    for count in range(12_000):
        stalled = 6000 <= count < 7000
        clock.observe(count, 5.0 + count * PERIOD_S + (30e-3 if stalled else 20e-6 + 1e-6 * (count % 7)))
    assert clock.host_time_s(12_000) == pytest.approx(5.0 + 6.0 + 20e-6, abs=1e-6)


def test_before_it_is_settled_it_follows_the_fastest_read():
    clock = SourceClock(PERIOD_S)
    clock.observe(0, 1.010)
    clock.observe(1, 1.0005)
    assert not clock.settled
    assert clock.host_time_s(1) == pytest.approx(1.0005)
