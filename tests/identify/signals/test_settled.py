"""Samples that count behind a low-pass: none beside a gap in which a torque may have stepped."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.low_pass import settled

STEP_S, CUTOFF_HZ = 4e-3, 6.5  # a period of 38 samples


@pytest.mark.parametrize(("lost", "counts"), [(1, True), (3, True), (12, False), (40, False)])
def test_beside_a_gap_of_a_tenth_of_a_period_the_low_pass_has_not_settled(lost: int, counts: bool) -> None:
    keep = np.ones(4000, dtype=bool)
    keep[2000 : 2000 + lost] = False
    inside = settled(keep, STEP_S, CUTOFF_HZ)
    assert bool(inside[1999]) is counts
    assert bool(inside[2000 + lost]) is counts
    assert inside[1000] and inside[3000]
    assert not np.any(inside[2000 : 2000 + lost])


def test_of_a_run_full_of_gaps_what_was_measured_stays() -> None:
    keep = np.ones(4000, dtype=bool)
    for first in range(100, 4000, 200):
        keep[first : first + 12] = False
    assert np.mean(settled(keep, STEP_S, CUTOFF_HZ)) > 0.8
