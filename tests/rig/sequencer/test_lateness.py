"""Lateness is counted in classes: the same memory for a minute and for a day, right to within a per cent."""

import math
import sys

import numpy as np
import pytest

from rig.sequencer.lateness import CLASS_RATIO, Lateness

LATE_S = np.random.default_rng(3).lognormal(math.log(5e-5), 1.2, 20_000)


@pytest.mark.parametrize("share", [0.001, 0.5, 0.99, 0.999])
def test_a_quantile_is_within_one_class_of_the_exact_one(share):
    exact = np.quantile(LATE_S, share, method="inverted_cdf")
    assert exact <= Lateness(LATE_S).quantile_s(share) <= exact * CLASS_RATIO * (1 + 1e-9)


def test_the_latest_tick_is_kept_as_it_was():
    late = Lateness(LATE_S)
    assert late.ticks == len(LATE_S)
    assert late.max_s == late.quantile_s(1.0) == LATE_S.max()


def test_ticks_on_time_before_time_and_hours_late_are_counted_too():
    late = Lateness([0.0, -1e-3, 0.0, 1e6])
    assert late.ticks == 4
    assert late.quantile_s(0.5) <= 1e-7
    assert late.quantile_s(1.0) == 1e6


def test_without_a_tick_there_is_no_quantile():
    assert math.isnan(Lateness().quantile_s(0.5))


def test_a_day_takes_no_more_memory_than_a_second():
    def size(late: Lateness) -> int:
        return sum(sys.getsizeof(value) for value in vars(late).values())

    assert size(Lateness(LATE_S)) == pytest.approx(size(Lateness()), abs=100)
