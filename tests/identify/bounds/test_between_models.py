"""Intervals of J, C and K hold how far they differ between models that the data do not part."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identify.bounds.between_models import model_spread


def model(cost: float, inertia: float, damping: float, stiffness: float | None = None) -> Any:
    values = {("inertia",): inertia, ("damping",): damping}
    return SimpleNamespace(cost=cost, values=values | ({("stiffness",): stiffness} if stiffness is not None else {}))


def ahead(one: Any, other: Any) -> float:
    return max(one.cost - other.cost, 0.0)


def test_without_a_rival_nothing_is_added() -> None:
    assert np.all(model_spread(model(0.0, 1.0, 1.0), ahead=ahead) == 0.0)


def test_a_rival_that_is_as_likely_counts_half() -> None:
    found = model_spread(model(5.0, 1.0, 2.0, 3.0), model(5.0, 1.2, 1.9, 3.0), ahead=ahead)
    assert found == pytest.approx([0.02, 0.005, 0.0])


def test_a_rival_counts_by_how_likely_it_is() -> None:
    chosen = model(0.0, 1.0, 1.0)
    found = [model_spread(chosen, model(cost, 2.0, 1.0), ahead=ahead)[0] for cost in (-200.0, -4.0, 4.0, 200.0)]
    assert found[0] == pytest.approx(1.0)
    assert found[1] == pytest.approx(np.exp(2.0) / (1.0 + np.exp(2.0)))
    assert found[2] == pytest.approx(1.0 / (1.0 + np.exp(2.0)))
    assert found[3] < 1e-20


def test_several_rivals_share_what_is_likely() -> None:
    found = model_spread(model(0.0, 1.0, 1.0), model(0.0, 1.3, 1.0), model(0.0, 1.0, 0.7), ahead=ahead)
    assert found == pytest.approx([0.03, 0.03, 0.0])


def test_a_term_that_only_one_of_them_has_counts_as_zero_in_the_other() -> None:
    assert model_spread(model(0.0, 1.0, 1.0, 4.0), model(0.0, 1.0, 1.0), ahead=ahead)[2] == pytest.approx(8.0)
