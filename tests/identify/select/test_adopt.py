"""A model found in torque is adopted unless the search's own is likelier, and then judged like that."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.model.structure import Structure
from identify.select import likelihood_search
from identify.select.likelihood_search import LikelihoodSearch

COST_WITH_CURVE, COST_IN_TORQUE, COST_WITHOUT = 0.0, 100.0, 1000.0


def fit(effects: tuple[str, ...], cost: float) -> Any:
    return SimpleNamespace(structure=Structure(effects=effects), values={}, cost=cost)


@pytest.mark.parametrize(
    ("found", "curve", "refuted"),
    [
        (("unbalance",), "free_angle", True),
        (("cogging", "cogging_2"), "free_angle", True),
        (("cogging", "cogging_2"), "free_time", False),
        (("cogging", "torque_offset"), "free_angle", False),
        (("unbalance",), None, False),
    ],
)
def test_a_curve_stands_only_against_effects_of_its_kind(
    monkeypatch: pytest.MonkeyPatch, found: tuple[str, ...], curve: str | None, refuted: bool
) -> None:
    monkeypatch.setattr(likelihood_search, "support_difference", lambda one, other: one.cost - other.cost)
    bare = fit((), COST_WITHOUT)
    left = curve and SimpleNamespace(form=curve, evidence=SimpleNamespace(fit=fit((), COST_WITH_CURVE)))
    problem = SimpleNamespace(fit=lambda structure, values: fit(structure.effects, COST_IN_TORQUE))
    compared: list[Any] = []
    monkeypatch.setattr(likelihood_search, "against_curves", lambda _, there: compared.append(there) or there)
    stepwise = SimpleNamespace(best=bare, base=bare, left=left, problem=problem, compare_with_free_form=lambda now: now)
    adopted = LikelihoodSearch(cast(Any, stepwise), [], Structure()).adopt(fit(found, 0.0))
    assert (adopted is None) is refuted
    assert compared == ([] if refuted else [stepwise.best])  # it has to stand against curves like the search's own
