"""Which names are compared with a curve together, beside which model, and what an agreement of blocks is made of."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.bounds.separation import block_costs
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.select import curve_rivals
from identify.select.curve_rivals import against_curves, is_beaten, still_offered
from identify.signals.prepare import one_noise, prepare
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Run
from tests.identify.simulated import TRUTH


class Searched:
    """A search that ended with some effects, in which a cubic spring has replaced the stiffness."""

    def __init__(self, *effects: str, terms: tuple[str, ...] = TERMS) -> None:
        self.base: Any = SimpleNamespace(structure=Structure(), values={(t,): 1.0 for t in TERMS})
        self.best: Any = SimpleNamespace(
            structure=Structure(terms, effects), values={("inertia",): 2.0}, noise=None, shots=()
        )
        self.trials = SimpleNamespace(added=lambda fit: list(fit.structure.effects))
        self.problem = SimpleNamespace(fit=self._fit)
        self.dropped = [("stiffness", "cubic_stiffness explains more in its place")] if terms != TERMS else []
        self.allowed = ["cubic_stiffness", "unbalance", "cogging", "coulomb_friction"]
        self.stood_for_curves: set[str] = set()
        self.in_place: Any = None

    def _fit(self, structure: Structure, values: Any, *_: Any, **__: Any) -> Any:
        return SimpleNamespace(structure=structure, values=values)

    def known(self, structure: Structure) -> None:
        return None

    def say(self, text: str) -> None:
        pass


def asked(monkeypatch: pytest.MonkeyPatch, search: Searched, beaten: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Groups of names that a curve was fitted for; of those ``beaten`` it is clearly likelier."""
    groups: list[tuple[str, ...]] = []

    def in_place(_: Any, now: Any, rest: Any, names: list[str], curves: list[str]) -> tuple[str, Any]:
        groups.append(tuple(names))
        return curves[0], SimpleNamespace(structure=rest.structure, names=tuple(names))

    monkeypatch.setattr(curve_rivals, "_in_place", in_place)
    monkeypatch.setattr(curve_rivals, "support_difference", lambda now, fit: 99.0 if fit.names == beaten else 0.0)
    is_beaten(cast(Any, search), search.best)
    return groups


def test_effects_of_different_kinds_over_one_quantity_are_judged_together_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = Searched("actuator_lag", "cubic_stiffness", "unbalance")
    singles = [("actuator_lag",), ("cubic_stiffness",), ("unbalance",)]
    assert asked(monkeypatch, search) == [*singles, ("cubic_stiffness", "unbalance")]


def test_a_term_that_an_effect_has_replaced_comes_back_before_a_curve_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Searched("cubic_stiffness", "unbalance", terms=("inertia", "damping"))
    asked(monkeypatch, search, ("cubic_stiffness", "unbalance"))
    less = against_curves(cast(Any, search), search.best)
    assert less.structure == Structure(TERMS, ())
    assert less.values == {("inertia",): 2.0, ("stiffness",): 1.0}  # type: ignore[comparison-overlap]
    assert [name for name, _ in search.dropped] == ["cubic_stiffness", "unbalance"]


def test_blocks_add_up_to_the_cost_of_all_readings() -> None:
    """Of a gyro and an encoder: only the gyro was counted."""
    rng, time = np.random.default_rng(2), 2e-3 * np.arange(1000)
    noise = rng.standard_normal((2, len(time)))
    torque = 60.0 * np.sin(2.0 * np.pi * 2.0 * time)
    motion = simulate(Platform(*TRUTH), time, TorqueSignal(time, torque), start=(0.0, 0.0))
    run = Run(
        "both", time, np.ones(len(time), bool), rate_rad_s=motion.sensed_rate_rad_s + 1e-3 * noise[0],
        angle_rad=motion.angle_rad + 1e-5 * noise[1], torque_time_s=time, torque_nm=torque,
    )  # fmt: skip
    problem = PredictionError(one_noise([prepare(run, 0)], False))
    assert problem.both
    fit = problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}, iterations=1, thorough=False)
    assert float(np.sum(block_costs(fit))) == pytest.approx(fit.cost + fit.count, rel=1e-9)


def test_what_is_of_the_kind_that_a_curve_has_beaten_is_not_offered_again(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Searched("cubic_stiffness", "coulomb_friction")
    asked(monkeypatch, search, ("cubic_stiffness",))
    search.best = against_curves(cast(Any, search), search.best)
    offered = still_offered(
        cast(Any, search), ["cubic_stiffness", "unbalance", "cogging_2", "coulomb_friction", "creep"]
    )
    assert "coulomb_friction" in offered and "creep" in offered
    assert not {"cubic_stiffness", "unbalance", "cogging_2"} & set(offered)
