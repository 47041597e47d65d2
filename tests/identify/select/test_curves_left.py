"""A curve that the likelihood believes is told, however little of the disturbance goes with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from identify.residual import Dependence
from identify.select import free_form_residual
from identify.select.evidence import Evidence
from identify.select.free_form_residual import FreeFormFit, curves_left

ALLOWED = {"inertia": 2.0, "damping": 10.0, "stiffness": 2.0}


@dataclass
class Search:
    """What of a search the curves beside its model are read from."""

    left: FreeFormFit | None = None
    doubtful: list[FreeFormFit] = field(default_factory=list)


def curve(form: str, gain: float, share: float) -> FreeFormFit:
    fit: Any = SimpleNamespace(count=10_000, penalised=-gain)
    return FreeFormFit(fit, Evidence(form, fit, gain, 1.0, 90.0, 0.0), share)


def told(search: Search, moved: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> list[str]:
    def dependence(_: Search, c: FreeFormFit) -> tuple[Dependence, dict[str, float]]:
        return Dependence(c.form, 0.1, 0.01, c.chance_level, (), ()), {"stiffness": moved[c.form]}

    monkeypatch.setattr(free_form_residual, "dependence_on", dependence)
    return [part.on for part, _ in curves_left(search, ALLOWED)]  # type: ignore[arg-type]


def test_a_curve_beside_which_the_disturbance_is_no_smaller_is_told_where_it_is_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = Search(doubtful=[curve("free_angle", 480.0, -0.05)])
    assert told(search, {"free_angle": 0.0}, monkeypatch) == ["free_angle"]


def test_of_several_the_likeliest_is_told_and_another_where_a_parameter_hangs_on_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = Search(doubtful=[curve("free_rate", 200.0, 0.05), curve("free_angle", 480.0, -0.05)])
    assert told(search, {"free_angle": 0.0, "free_rate": 1.0}, monkeypatch) == ["free_angle"]
    assert told(search, {"free_angle": 0.0, "free_rate": 3.0}, monkeypatch) == ["free_angle", "free_rate"]


def test_one_that_is_hardly_believed_is_told_only_where_a_parameter_hangs_on_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    search = Search(doubtful=[curve("free_angle", 60.0, 0.05)])
    assert told(search, {"free_angle": 1.0}, monkeypatch) == []
    assert told(search, {"free_angle": 3.0}, monkeypatch) == ["free_angle"]
