"""Thinned data look like the data."""

from __future__ import annotations

import numpy as np

from identify.report.page.plots.thinning import binned_mean, cloud, line


def test_a_line_keeps_its_highest_and_lowest_sample_and_both_ends() -> None:
    x = np.arange(100_000.0)
    y = np.sin(x / 7.0)
    y[[31_234, 77_777]] = 9.0, -9.0
    thin_x, thin_y = line(x, y, 3000)
    assert len(thin_x) <= 3000
    assert (thin_y.max(), thin_y.min()) == (9.0, -9.0)
    assert (thin_x[0], thin_x[-1]) == (0.0, 99_999.0)
    assert np.all(np.diff(thin_x) > 0.0)


def test_a_gap_stays_a_gap() -> None:
    y = np.ones(10_000)
    y[4000:6000] = np.nan
    x, thin = line(np.arange(10_000.0), y, 500)
    assert np.all(np.isnan(thin[(x >= 4050) & (x < 5950)]))
    assert np.isfinite(thin[x < 3950]).all()


def test_a_short_line_is_left_as_it_is() -> None:
    x, y = np.arange(10.0), np.ones(10)
    assert line(x, y, 3000) == (x, y)


def test_a_cloud_is_thinned_the_same_way_every_time() -> None:
    x = np.arange(10_000.0)
    x[5] = np.nan
    first, second = cloud(x, x, 100), cloud(x, x, 100)
    assert len(first[0]) == 100
    assert np.array_equal(first[0], second[0])


def test_means_in_bins_follow_the_curve_and_leave_sparse_bins_out() -> None:
    x = np.append(np.linspace(-1.0, 1.0, 4001), 5.0)
    at, mean = binned_mean(x, x**2)
    assert np.allclose(mean, at**2, atol=0.02)
    assert at.max() < 1.2


def test_means_of_nothing_are_nothing() -> None:
    nothing = np.full(10, np.nan)
    assert len(binned_mean(nothing, nothing)[0]) == 0
    assert len(binned_mean(np.ones(10), np.ones(10))[0]) == 0
