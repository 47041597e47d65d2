"""Change points of series whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from identify.report.trend.change_points import MIN_CAMPAIGNS, levels, scatter


def noisy(means: list[float], scatter_: float = 1.0, seed: int = 0) -> np.ndarray:
    return np.array(means) + scatter_ * np.random.default_rng(seed).standard_normal(len(means))


def begins(values: np.ndarray, std_error: float = 1.0) -> list[int]:
    return [level.first for level in levels(values, np.full(len(values), std_error))]


def test_one_jump_is_found_where_it_is_with_both_levels() -> None:
    found = levels(noisy([10.0] * 12 + [20.0] * 8), np.ones(20))
    assert [(one.first, one.last) for one in found] == [(0, 11), (12, 19)]
    assert found[0].mean == pytest.approx(10.0, abs=1.0) and found[1].mean == pytest.approx(20.0, abs=1.2)


def test_several_jumps_are_found_together() -> None:
    assert begins(noisy([0.0] * 10 + [8.0] * 5 + [-4.0] * 15)) == [0, 10, 15]


def test_a_constant_series_has_one_level_whose_mean_weighs_by_the_intervals() -> None:
    (level,) = levels(np.array([1.0, 3.0]), np.array([1.0, 0.5]))
    assert level.mean == pytest.approx((1.0 + 4 * 3.0) / 5)
    assert level.std_error == pytest.approx(5.0**-0.5)


@pytest.mark.parametrize("values", [[5.0] * 9, [0.0] * 9])
def test_equal_values_without_an_interval_have_one_level(values: list[float]) -> None:
    (level,) = levels(np.array(values), np.zeros(9))
    assert (level.first, level.last, level.mean) == (0, 8, pytest.approx(values[0]))


@pytest.mark.parametrize("where", [0, 7, 19])
def test_a_single_campaign_that_is_off_is_no_change(where: int) -> None:
    values = noisy([0.0] * 20)
    values[where] += 12.0
    assert begins(values) == [0]


def test_a_second_campaign_at_the_new_level_confirms_the_first() -> None:
    values = noisy([0.0] * 19 + [12.0] * 2)
    assert begins(values[:-1]) == [0]
    assert begins(values) == [0, 19]


def test_campaigns_that_scatter_more_than_their_intervals_are_not_taken_for_changes() -> None:
    """Standard errors of 0.01 beside a scatter of 1: by the intervals alone each campaign would be a level."""
    values = noisy([0.0] * 30)
    assert begins(values, 0.01) == [0]
    assert scatter(values, np.full(30, 0.01)) == pytest.approx(1.0, rel=0.4)
    assert begins(values + np.repeat([0.0, 8.0], 15), 0.01) == [0, 15]


def test_a_campaign_with_a_wide_interval_weighs_little() -> None:
    values, errors = noisy([0.0] * 20), np.ones(20)
    values[8:10], errors[8:10] = 40.0, 50.0
    assert len(levels(values, errors)) == 1


def test_a_common_offset_does_not_matter() -> None:
    values = noisy([0.0] * 10 + [6.0] * 10)
    assert begins(values) == begins(values + 1e7) == [0, 10]


def test_too_few_campaigns_have_one_level_and_none_has_none() -> None:
    few = np.array([0.0, 0.0, 0.0, 90.0, 90.0])
    assert len(few) < MIN_CAMPAIGNS
    assert begins(few) == [0]
    assert levels(np.array([]), np.array([])) == ()


def test_series_without_a_change_rarely_show_one() -> None:
    rng = np.random.default_rng(5)
    alarms = sum(len(levels(rng.standard_normal(20), np.ones(20))) > 1 for _ in range(300))
    assert alarms <= 12  # 1 % is expected
