"""What the search in torque found is named only where the likelihood, if it is right about all of it, supports it."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.model.structure import Structure
from identify.select.evidence import STRONG_SUPPORT, TRUSTED
from identify.select.likelihood_search import LikelihoodSearch

WELL, BADLY = 10.0 * STRONG_SUPPORT, -STRONG_SUPPORT
RIGHT, WRONG = 1.0, 2.0 * TRUSTED


def fit(structure: Structure) -> Any:
    return SimpleNamespace(structure=structure, values={}, cost=0.0)


def search(support: dict[str, float], inflation: float) -> LikelihoodSearch:
    """A search whose likelihood says what it is told to."""

    def evidence(effect: str, without: Any, now: Any) -> Any:
        assert without.structure == now.structure.minus(effect)
        return SimpleNamespace(effect=effect, support=support[effect], inflation=inflation)

    def all_without(now: Any, names: Sequence[str]) -> list[Any]:
        return [fit(now.structure.minus(name)) for name in names]

    steps = SimpleNamespace(
        base=fit(Structure()), problem=SimpleNamespace(fit=lambda structure, values: fit(structure)),
        weigher=SimpleNamespace(evidence=evidence), all_without=all_without,
    )  # fmt: skip
    return LikelihoodSearch(cast(Any, steps), [], Structure())


@pytest.mark.parametrize(
    ("support", "inflation", "dropped"),
    [
        ({"coulomb_friction": WELL, "periodic_disturbance": BADLY}, RIGHT, "periodic_disturbance"),
        ({"coulomb_friction": WELL, "torque_offset": WELL}, RIGHT, None),
        ({"coulomb_friction": WELL, "periodic_disturbance": BADLY}, WRONG, None),
        ({"torque_offset": BADLY, "quadratic_stiffness": WELL}, RIGHT, None),  # the constant stands with the square
    ],
)
def test_the_effect_that_the_likelihood_supports_least_is_dropped(
    support: dict[str, float], inflation: float, dropped: str | None
) -> None:
    assert search(support, inflation).unsupported(fit(Structure(effects=tuple(support)))) == dropped
