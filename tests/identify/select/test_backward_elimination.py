"""What is needless goes, the least needed first: what the others are worth shows only once it has gone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.likelihood.fit import KnownFits
from identify.model.structure import Structure
from identify.select.evidence import Evidence
from identify.select.needed_terms import is_light
from identify.select.stepwise import Stepwise

JCK = ("inertia", "damping", "stiffness")
Supports = dict[frozenset[str], dict[str, float]]
# Of effects beside others: a friction that yields and a spring that softens, beside one that is not there.
SUPPORT: Supports = {
    frozenset({"bilinear_stiffness", "presliding_friction", "quadratic_stiffness"}): {
        "presliding_friction": 8.0, "quadratic_stiffness": 6.0, "bilinear_stiffness": -12.0,
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


@pytest.mark.parametrize("first", ["presliding_friction", "quadratic_stiffness", "bilinear_stiffness"])
def test_the_least_needed_goes_first_whatever_the_order(first: str) -> None:
    """In a fixed order the friction and the spring went, one after the other, and the wrong spring was left."""
    effects = (first, *(e for e in next(iter(SUPPORT)) if e != first))
    found, _ = search(SUPPORT)
    best = found.backward_elimination(fit(Structure(JCK, effects)), [*JCK, *effects])
    assert set(best.structure.effects) == {"presliding_friction", "quadratic_stiffness"}
    assert [name for name, _ in found.dropped] == ["bilinear_stiffness"]


def test_what_is_not_in_doubt_is_not_asked() -> None:
    found, asked = search(SUPPORT)
    found.needed = {"presliding_friction": 1e4, "quadratic_stiffness": 1e4}
    found.backward_elimination(fit(Structure(JCK, tuple(next(iter(SUPPORT))))), [*JCK, *next(iter(SUPPORT))])
    assert set(asked) == {"bilinear_stiffness"}


def test_of_two_that_stand_for_each_other_one_stays() -> None:
    both = frozenset({"cogging", "unbalance"})
    found, _ = search({both: {"cogging": 1.0, "unbalance": 2.0}, frozenset({"unbalance"}): {"unbalance": 500.0}})
    best = found.backward_elimination(fit(Structure(JCK, tuple(both))), list(both))
    assert best.structure.effects == ("unbalance",)


@pytest.mark.parametrize(
    ("name", "weight", "light"),
    [
        ("cogging", 0.1, True),
        ("cogging", 0.3, False),
        ("sensor_lag", 0.1, False),
        ("torque_delay", 0.1, False),
        ("damping", 0.1, False),
    ],
)
def test_what_is_late_is_not_asked_for_its_weight_again(name: str, weight: float, light: bool) -> None:
    """A torque residual hid a lag beside a friction: worth 6,853 of the cost, it was dropped."""
    found, _ = search({})
    values = {("sensor_lag", "time"): 1e-3, ("torque_delay", "delay"): 1e-3}
    less: Any = SimpleNamespace(structure=Structure(JCK), values={}, names=())
    more: Any = SimpleNamespace(
        structure=Structure(JCK, ("sensor_lag", "torque_delay")), values=values, names=tuple(values)
    )
    assert is_light(found, Evidence(name, more, 5e3, 1.0, 9.0, weight), less, more) is light


def test_the_best_fit_of_a_structure_is_kept() -> None:
    known = KnownFits()
    first, better, worse = (SimpleNamespace(structure=Structure(JCK, ("cogging",)), cost=c) for c in (3.0, 1.0, 2.0))
    assert known.best(cast(Any, first)) is first
    assert known.best(cast(Any, better)) is better
    assert known.best(cast(Any, worse)) is better
    assert known.of(Structure(tuple(reversed(JCK)), ("cogging",))) is better
    assert known.of(Structure(JCK)) is None


def test_another_order_of_the_drive_is_another_structure() -> None:
    known = KnownFits()
    known.best(cast(Any, SimpleNamespace(structure=Structure(JCK, ("actuator_lag", "torque_saturation")), cost=1.0)))
    assert known.of(Structure(JCK, ("torque_saturation", "actuator_lag"))) is None


@pytest.mark.parametrize(("gain", "chosen"), [(950.0, "bilinear_stiffness"), (200.0, "cogging")])
def test_a_simple_effect_goes_first_only_if_it_makes_most_of_the_fall(
    gain: float, chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spring of two slopes with less of the fall, not separated by blocks that scatter, was added."""
    monkeypatch.setattr("identify.select.stepwise.support_difference", lambda one, other: 0.0)
    found, _ = search({})

    def tried(name: str, gain: float, parameters: int) -> Evidence:
        new: Any = SimpleNamespace(penalised=-gain, names=tuple(str(k) for k in range(parameters)))
        return Evidence(name, new, gain, 1.0, 9.0, 0.5)

    found.weigher.left = lambda there: 1.0  # type: ignore[method-assign]
    found.weigher.in_torque = lambda there: there  # type: ignore[method-assign,assignment,return-value]
    both = {
        "bilinear_stiffness": tried("bilinear_stiffness", gain, 1),
        "cogging": tried("cogging", 1e3, 2),
    }
    assert found.best_candidate(both) == chosen


@pytest.mark.parametrize(
    ("inflation", "damping", "chosen"), [(12.0, -4.4, "sensor_lag"), (1.0, -4.4, "creep"), (12.0, 1.2, "creep")]
)
def test_a_model_that_feeds_the_motion_is_not_added_where_a_passive_one_is_believed_more(
    inflation: float, damping: float, chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Creep beside a damping below zero is late as a lag is; the hysteresis that was hidden was then not found."""
    monkeypatch.setattr("identify.select.stepwise.support_difference", lambda one, other: abs(one.cost - other.cost))
    found, _ = search({})

    def tried(name: str, gain: float, damping: float, inflation: float) -> Evidence:
        new: Any = SimpleNamespace(
            penalised=-gain, cost=-gain, names=(("damping",),), values={("damping",): damping}, std_error=lambda n: 0.1
        )
        return Evidence(name, new, gain, inflation, 9.0, 0.96)

    found.weigher.left = lambda there: 1.0  # type: ignore[method-assign]
    found.weigher.in_torque = lambda there: there  # type: ignore[method-assign,assignment,return-value]
    both = {"creep": tried("creep", 3052.0, damping, inflation), "sensor_lag": tried("sensor_lag", 2334.0, 1.2, 4.3)}
    assert found.best_candidate(both) == chosen
