"""A curve that is believed stands against effects of its own kind that were found in torque, and against no others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.model.structure import Structure
from identify.select import likelihood_search
from identify.select.likelihood_search import LikelihoodSearch

COST_WITH_CURVE, COST_IN_TORQUE, COST_WITHOUT = 0.0, 100.0, 1000.0


def fit(effects: tuple[str, ...], cost: float) -> Any:
    return SimpleNamespace(structure=Structure(effects=effects), values={}, names=(), cost=cost)


@pytest.mark.parametrize(
    ("found", "curve", "refuted"),
    [
        (("unbalance",), "free_angle", True),
        (("cogging", "cogging_2"), "free_angle", True),
        (("cogging", "cogging_2"), "free_time", False),
        (("cogging", "torque_offset"), "free_angle", True),  # a constant is a part of any curve
        (("torque_offset",), "free_time", True),
        (("coulomb_friction", "torque_offset"), "free_angle", False),
        (("unbalance",), None, False),
    ],
)
def test_a_curve_refutes_only_effects_of_its_kind(
    monkeypatch: pytest.MonkeyPatch, found: tuple[str, ...], curve: str | None, refuted: bool
) -> None:
    monkeypatch.setattr(likelihood_search, "support_difference", lambda one, other: one.cost - other.cost)
    bare = fit((), COST_WITHOUT)
    left = curve and SimpleNamespace(form=curve, evidence=SimpleNamespace(fit=fit((), COST_WITH_CURVE)))
    problem = SimpleNamespace(fit=lambda structure, values: fit(structure.effects, COST_IN_TORQUE))
    search = LikelihoodSearch(
        cast(Any, SimpleNamespace(best=bare, base=bare, left=left, problem=problem)), [], Structure(), cast(Any, None)
    )
    assert search.refutes(Structure(effects=found), {}) is refuted


def test_a_model_that_takes_a_delay_for_a_negative_damping_is_refuted_however_likely(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(likelihood_search, "support_difference", lambda one, other: 0.0)
    bare, there = fit((), COST_WITHOUT), fit(("creep",), 0.0)
    there.names, there.values, there.std_error = (("damping",),), {("damping",): -2.4}, lambda name: 0.03
    problem = SimpleNamespace(fit=lambda structure, values: there)
    search = LikelihoodSearch(
        cast(Any, SimpleNamespace(best=bare, base=bare, left=None, problem=problem)), [], Structure(), cast(Any, None)
    )
    assert search.refutes(Structure(effects=("creep",)), {})
