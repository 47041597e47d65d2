"""More waves over the angle are looked for only where the longest of those that are there is seen to repeat."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.runs.observability import one_more


@pytest.mark.parametrize(
    ("travel_deg", "orders", "more"),
    [
        (360.0, {"cogging": 7.0}, ["cogging_2"]),  # the waves of a motor, over two turns
        (10.0, {"cogging": 19.0}, []),  # a stop at either end: one wave over the travel, and its harmonics
        (10.0, {"cogging": 57.0}, ["cogging_2"]),
        (10.0, {"cogging": 57.0, "cogging_2": 19.0}, []),
        (10.0, {}, []),
    ],
)
def test_waves_that_are_not_seen_twice_are_a_series(
    travel_deg: float, orders: dict[str, float], more: list[str]
) -> None:
    traces = [SimpleNamespace(travel_deg=0.1 * travel_deg), SimpleNamespace(travel_deg=travel_deg)]
    values = {(name, "order"): order for name, order in orders.items()}
    assert one_more(("coulomb_friction", *orders), values, cast(Any, traces)) == more


def test_two_periods_are_just_enough() -> None:
    trace: Any = SimpleNamespace(travel_deg=math.degrees(1.0))
    for order, enough in ((2.0 * math.pi + 1e-9, True), (2.0 * math.pi - 1e-9, False)):
        assert bool(one_more(("cogging",), {("cogging", "order"): order}, [trace])) is enough
