"""A search in torque ends where what it adds takes it back to a model that was there before."""

from __future__ import annotations

from typing import Any

import numpy as np

from identify.diagnose.torque_fit import TorqueFit
from identify.model.structure import Structure
from identify.select.torque_search import TorqueCandidate, TorqueSearch


def fit(structure: Structure) -> TorqueFit:
    nothing = np.zeros(0)
    return TorqueFit(structure, (), nothing, np.zeros((0, 0)), 0.0, 1.0, 100, 1.0, [nothing], [nothing], nothing)


class GoingRound(TorqueSearch):
    """Each of two effects is heavy beside nothing, and neither beside the other."""

    def candidates(self, now: TorqueFit) -> list[TorqueCandidate]:
        name = "unbalance" if not now.structure.effects else "creep"
        return [TorqueCandidate(name, fit(now.structure.plus(name)), 0.9, 100.0, 9.0, 9.0)]

    def best_candidate(self, looks: list[TorqueCandidate]) -> TorqueCandidate:  # type: ignore[override]
        return looks[0]

    def without_absorbing_stiffness(self, now: TorqueFit) -> TorqueFit:
        return now

    def backward_elimination(self, now: TorqueFit) -> TorqueFit:
        return now if len(now.structure.effects) < 2 else fit(Structure())


def test_a_search_that_goes_round_ends() -> None:
    said: list[str] = []
    regression: Any = None
    found = GoingRound(regression, fit(Structure()), 0.0, 1.0, ["unbalance", "creep"], said.append).run()
    assert found.structure == Structure()
    assert len(said) == 2
