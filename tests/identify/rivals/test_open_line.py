"""A line that may be the sensor's own is not named; the numbers beside it, and what is left, stay as with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.results import Candidate
from identify.rivals import open_line
from identify.rivals.open_line import with_line_left_open
from identify.rivals.tone_origin import TONE, SpectralLine
from identify.select.search_state import Found, Search


def final(effects: tuple[str, ...], inertia: float, error: float) -> FinalFit:
    names = [("inertia",), ("damping",), *((e, "value") for e in effects)]
    fit: Any = SimpleNamespace(structure=Structure(effects=effects), values={})
    values = dict.fromkeys(names, 1.0) | {("inertia",): inertia}
    return FinalFit(
        fit, values, tuple(names), np.diag([error**2] * len(names)), None, False, (True,) * len(names),
        "prediction error",
    )  # fmt: skip


LINE = SpectralLine(5.0, 0.1, 0.01)


def left_open(
    monkeypatch: pytest.MonkeyPatch,
    line: SpectralLine | None,
    beside: str | None,
    channel: str = "rate",
    judged: Callable[[Found], Found] = lambda found: found,
    lines: Disturbance | None = None,
) -> tuple[Found, Found]:
    """What the search found with a tone, maybe beside something else, and the same with the line left open."""
    effects = (TONE,) if beside is None else (beside, TONE)
    monkeypatch.setattr(open_line, "standing_line", lambda final, traces: line)
    monkeypatch.setattr(open_line, "describe", lambda line, axis, channel: ("left open.", "try this."))
    monkeypatch.setattr(open_line, "free_run_of", lambda *_: "simulated anew")

    def lacking(*names: str, others: str | None = None) -> Any:
        rest = tuple(e for e in effects if e not in names)
        return final(rest, 1.3, 0.2), None, Disturbance(0.5, "N*m", 0.5)

    with_tone, nothing = final(effects, 1.0, 0.01), cast(Any, None)
    search = Search(final((), 1.3, 0.2).fit, with_tone.fit, 0.0, 0.0)
    search.candidates = [Candidate(name, 1, -100.0, None, "added") for name in effects]
    left = Disturbance(0.01, "N*m", 0.01)
    found = Found(search, final((), 1.3, 0.2), with_tone, left, (nothing, nothing), lacking, nothing)
    monkeypatch.setattr(
        Found, "with_lines", lambda self, likeliest, torque_nm: replace(self, disturbance=lines or self.disturbance)
    )
    best: Any = SimpleNamespace(structure=Structure())
    stepwise: Any = SimpleNamespace(best=best, problem=SimpleNamespace(torque_nm=1.0))
    traces: Any = [SimpleNamespace(channel=channel, beside=None)]
    return found, with_line_left_open(found, stepwise, traces, [], "rotary", lambda text: None, judged)


def test_the_numbers_of_the_others_are_those_beside_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    _, less = left_open(monkeypatch, LINE, "coulomb_friction")
    assert less.named == ["coulomb_friction"]
    assert less.after.values["inertia",] == 1.0
    assert less.after.std_error(("inertia",)) == pytest.approx(0.01)
    assert (TONE, "value") not in less.after.names
    assert less.after.free_run == "simulated anew"  # type: ignore[comparison-overlap]
    assert less.disturbance.torque_rms == 0.01
    assert less.search.left_open == "left open."


def test_what_stands_at_the_line_does_not_speak_against_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are judged by what is left beside the line; that it stands there is told afterwards."""
    at: list[Disturbance] = []

    def judged(found: Found) -> Found:
        at.append(found.disturbance)
        return found

    lines = Disturbance(0.3, "N*m", 0.3)
    _, less = left_open(monkeypatch, LINE, "coulomb_friction", judged=judged, lines=lines)
    assert [d.torque_rms for d in at] == [0.01]
    assert less.disturbance is lines


def test_a_line_alone_leaves_the_declared_model(monkeypatch: pytest.MonkeyPatch) -> None:
    _, less = left_open(monkeypatch, LINE, None)
    assert less.named == []


def test_a_line_that_is_a_torque_stays_named(monkeypatch: pytest.MonkeyPatch) -> None:
    found, less = left_open(monkeypatch, None, "coulomb_friction")
    assert less is found


def test_an_encoder_has_no_line_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    found, less = left_open(monkeypatch, LINE, "coulomb_friction", "angle")
    assert less is found


def test_runs_whose_own_torque_has_that_frequency_had_another_torque_under_any_sensor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, less = left_open(monkeypatch, replace(LINE, of_torque=True), "coulomb_friction", "angle")
    assert less.named == ["coulomb_friction"]
    assert less.after.values["inertia",] == 1.0
