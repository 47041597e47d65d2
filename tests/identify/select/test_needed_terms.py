"""What stands in the place of a damping, or against a spring, goes where another model does as well without."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.select.needed_terms import _needless_beside, without_cancelled_stiffness
from identify.signals.prepare import one_noise, prepare
from tests.identify.simulated import sine_run

JCK = (0.02, 0.3, 677.3)
CREEP, DELAY = "creep", "torque_delay"
WITHOUT_DAMPING = Structure(("inertia", "stiffness"), (CREEP, DELAY))


def without_damping(hidden: dict[str, dict[str, float]]) -> tuple[Any, Any]:
    """A search over runs with something hidden, and its model with a creep and a delay in the place of the damping."""
    runs = [sine_run(60.0, f, effects=hidden, jck=JCK, duration_s=1.5) for f in (2.0, 9.0, 25.0)]
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    start: dict[Name, float] = {
        ("inertia",): 0.02, ("stiffness",): 677.3, (CREEP, "stiffness"): 60.0, (CREEP, "time"): 5e-3,
        (DELAY, "delay"): 1e-3,
    }  # fmt: skip
    instead = problem.fit(WITHOUT_DAMPING, start, thorough=False)
    said: list[str] = []
    trials = SimpleNamespace(added=lambda fit: list(fit.structure.effects))
    base = SimpleNamespace(values={("damping",): 0.1})
    return SimpleNamespace(problem=problem, trials=trials, base=base, say=said.append, said=said), instead


def test_a_creep_that_only_damped_goes_when_the_damping_is_back() -> None:
    search, instead = without_damping({DELAY: {"delay": 7e-4}})
    found = _needless_beside(cast(Any, search), "damping", instead)
    assert found is not None
    assert found.structure.terms == ("inertia", "damping", "stiffness")
    assert found.structure.effects == (DELAY,)
    assert found.values[("damping",)] == pytest.approx(0.3, rel=0.01)
    assert found.values[("inertia",)] == pytest.approx(0.02, rel=1e-3)
    assert search.said == ["dropped creep: damping does as well in its place"]


def test_a_creep_that_is_there_stays() -> None:
    search, instead = without_damping({CREEP: {"stiffness": 60.0, "time": 0.05}, DELAY: {"delay": 7e-4}})
    found = _needless_beside(cast(Any, search), "damping", instead)
    assert found is None or CREEP in found.structure.effects


UNBALANCE, CUBIC = "unbalance", "cubic_stiffness"


def with_gravity(hidden: dict[str, dict[str, float]], spring: float, sine: float) -> tuple[Any, Any]:
    """A search over runs with something hidden, and its model with gravity beside a spring."""
    runs = [sine_run(60.0, f, effects=hidden, jck=JCK, duration_s=1.5) for f in (2.0, 9.0)]
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    start: dict[Name, float] = {
        ("inertia",): 0.02, ("damping",): 0.3, ("stiffness",): spring, (UNBALANCE, "sine"): sine,
    }  # fmt: skip
    fit = problem.fit(Structure(effects=(UNBALANCE,)), start, thorough=False)
    said: list[str] = []
    trials = SimpleNamespace(added=lambda fit: list(fit.structure.effects))
    return SimpleNamespace(problem=problem, trials=trials, allowed=[CUBIC], say=said.append, said=said), fit


def test_gravity_that_cancels_most_of_a_spring_is_a_spring_that_bends() -> None:
    """A stiffness 3.7 times too large was accepted beside it, and named unbalance."""
    search, fit = with_gravity({CUBIC: {"factor": 300.0}}, 2477.0, -1800.0)
    assert fit.values[("stiffness",)] > 2.0 * JCK[2]
    found = without_cancelled_stiffness(cast(Any, search), fit)
    assert found.structure.effects == (CUBIC,)
    assert found.values[("stiffness",)] == pytest.approx(JCK[2], rel=1e-4)
    assert found.values[(CUBIC, "factor")] == pytest.approx(300.0, rel=0.01)
    assert search.said == ["replaced unbalance by cubic stiffness: it does as well beside a weaker spring"]


def test_gravity_that_is_there_stays() -> None:
    search, fit = with_gravity({UNBALANCE: {"sine": 100.0, "cosine": 5.0}}, 677.0, 100.0)
    assert without_cancelled_stiffness(cast(Any, search), fit) is fit
