"""Before a third effect of one kind is added, a curve in the place of the first two is asked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.model.structure import Structure
from identify.select import forward_selection
from identify.select.forward_selection import add_effects

WAVES = ("cogging", "cogging_2", "cogging_3", "cogging_4")


class Waves:
    """A search that finds one more wave in every round."""

    def __init__(self) -> None:
        self.best: Any = SimpleNamespace(structure=Structure(), arrived=True)
        self.rounds: list[Any] = []
        self.settled: list[str] = []  # no search came before this one
        self.trials = SimpleNamespace(added=lambda fit: list(fit.structure.effects), pairs=lambda now, scores: [])
        self.said: list[str] = []

    def score_candidates(self, now: Any) -> tuple[list[Any], dict[str, Any]]:
        found = len(now.structure.effects)
        if found == len(WAVES):
            return [], {}
        name = WAVES[found]
        fit = SimpleNamespace(structure=now.structure.plus(name), arrived=True)
        return [], {name: SimpleNamespace(effect=name, fit=fit, gain=100.0, weight=0.5, support=0.0)}

    def best_candidate(self, tried: dict[str, Any]) -> str | None:
        return next(iter(tried), None)

    def backward_elimination(self, fit: Any, names: object) -> Any:
        return fit

    def say(self, text: str) -> None:
        self.said.append(text)


@pytest.mark.parametrize(("beaten", "kept", "asked"), [(True, 2, [2]), (False, 4, [2, 3])])
def test_a_curve_is_asked_before_a_third_wave(
    monkeypatch: pytest.MonkeyPatch, beaten: bool, kept: int, asked: list[int]
) -> None:
    seen: list[int] = []

    def is_beaten(search: Waves, now: Any) -> bool:
        seen.append(len(now.structure.effects))
        return beaten

    monkeypatch.setattr(forward_selection, "is_beaten", is_beaten)
    search = Waves()
    add_effects(cast(Any, search))
    assert search.best.structure.effects == WAVES[:kept]
    assert seen == asked
