"""What is needless goes, the least needed first: what the others are worth shows only once it has gone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from identify.model.structure import Structure
from identify.select.evidence import Evidence
from identify.select.stepwise import Stepwise

JCK = ("inertia", "damping", "stiffness")
Supports = dict[frozenset[str], dict[str, float]]
# Of effects beside others. A friction that yields and a spring that softens stand for each other beside a lag.
SUPPORT: Supports = {
    frozenset({"sensor_lag", "presliding_friction", "quadratic_stiffness"}): {
        "presliding_friction": 8.0, "quadratic_stiffness": 6.0, "sensor_lag": -12.0,
    },
    frozenset({"presliding_friction", "quadratic_stiffness"}): {
        "presliding_friction": 900.0, "quadratic_stiffness": 400.0,
    },
}  # fmt: skip


def fit(structure: Structure) -> Any:
    values = {(t,): 1.0 for t in structure.terms}
    return SimpleNamespace(
        structure=structure, values=values, cost=0.0, reduced_chi_square=1.0, std_error=lambda name: 1e-6
    )


def search(supports: Supports, weight: float = 1.0) -> tuple[Stepwise, list[str]]:
    """A search over effects whose support is known, and the names that were asked for, in turn."""
    asked: list[str] = []

    def evidence(name: str, less: Any, more: Any, **_: bool) -> Evidence:
        asked.append(name)
        return Evidence(name, more, supports[frozenset(more.structure.effects)][name], 1.0, 0.0, weight)

    problem: Any = SimpleNamespace(angle_rad=1.0, torque_nm=1.0)
    out = Stepwise(problem, fit(Structure(JCK)), (), SimpleNamespace(evidence=evidence))  # type: ignore[arg-type]
    out.all_without = lambda now, names, steps=0: [fit(now.structure.minus(n)) for n in names]  # type: ignore[method-assign]
    return out, asked


@pytest.mark.parametrize("first", ["presliding_friction", "quadratic_stiffness", "sensor_lag"])
def test_the_least_needed_goes_first_whatever_the_order(first: str) -> None:
    """In a fixed order the friction and the spring went, one after the other, and the lag was left."""
    effects = (first, *(e for e in next(iter(SUPPORT)) if e != first))
    found, _ = search(SUPPORT)
    best = found.backward_elimination(fit(Structure(JCK, effects)), [*JCK, *effects])
    assert set(best.structure.effects) == {"presliding_friction", "quadratic_stiffness"}
    assert [name for name, _ in found.dropped] == ["sensor_lag"]


def test_what_is_not_in_doubt_is_not_asked() -> None:
    found, asked = search(SUPPORT)
    found.needed = {"presliding_friction": 1e4, "quadratic_stiffness": 1e4}
    found.backward_elimination(fit(Structure(JCK, tuple(next(iter(SUPPORT))))), [*JCK, *next(iter(SUPPORT))])
    assert set(asked) == {"sensor_lag"}


def test_of_two_that_stand_for_each_other_one_stays() -> None:
    both = frozenset({"cogging", "unbalance"})
    found, _ = search({both: {"cogging": 1.0, "unbalance": 2.0}, frozenset({"unbalance"}): {"unbalance": 500.0}})
    best = found.backward_elimination(fit(Structure(JCK, tuple(both))), list(both))
    assert best.structure.effects == ("unbalance",)
