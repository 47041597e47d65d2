"""Which of several models is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.output_error import Estimate
from identify.model.parameters import names_of
from identify.model.structure import Structure
from identify.select.criterion import simplest
from identify.select.free_run_fit import Whole

COUNT = 10_000


def fitted(name: str, level: float) -> Whole:
    """A model with one effect that leaves ``level`` times the noise's variance."""
    structure = Structure(effects=(name,))
    names = names_of(structure, 1)
    estimate = Estimate(structure, names, np.ones(len(names)), 1.0, COUNT, np.eye(len(names)), (), True)
    return Whole(estimate, level * COUNT, COUNT, level * COUNT, COUNT, np.ones(1), np.ones(1))


@pytest.mark.parametrize(
    ("levels", "chosen"),
    [
        ({"quadratic_stiffness": 2700.0, "cogging": 2400.0}, "quadratic_stiffness"),  # far off it follows what is left
        ({"quadratic_stiffness": 2700.0, "cogging": 1200.0}, "cogging"),
        ({"quadratic_stiffness": 1.3, "cogging": 1.0}, "cogging"),  # at the noise likelihood decides
        ({"quadratic_stiffness": 1.0, "cogging": 1.0}, "quadratic_stiffness"),
        ({"torque_delay": 1.7, "creep": 1.3}, "torque_delay"),  # something else is missing, and creep took a part of it
        ({"torque_delay": 1.7, "creep": 1.04}, "creep"),
        ({"quadratic_stiffness": 2700.0, "cubic_stiffness": 2400.0}, "cubic_stiffness"),
        ({"actuator_lag": 1.0, "sensor_lag": 1.0}, "actuator_lag"),
    ],
)
def test_what_can_follow_anything_displaces_a_plain_effect_only_where_it_explains_much_more(
    levels: dict[str, float], chosen: str
) -> None:
    assert simplest({n: fitted(n, level) for n, level in levels.items()}) == chosen


def test_one_that_only_its_settling_put_behind_is_no_less_likely() -> None:
    """Chance lifts one of two bottoms of a dented valley by more than what parts their minima."""
    best, other = fitted("actuator_lag", 1.0), fitted("torque_delay", 1.0015)
    assert other.behind(best) == pytest.approx(15.0)
    both = replace(best, unsettled=best.squares - 2.0), replace(other, unsettled=best.squares + 3.0)
    assert both[1].behind(both[0]) == pytest.approx(5.0)
    worse_before = replace(other, unsettled=other.squares - 1.0)
    assert worse_before.behind(both[0]) == pytest.approx(15.0)
