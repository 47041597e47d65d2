"""The gyro's own low-pass is no name: where it is likelier than not, the numbers are those beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit
from identify.likelihood.fit import Fit, Prediction
from identify.model.structure import Structure
from identify.residual import Dependence, Disturbance
from identify.rivals import open_line, own_low_pass
from identify.rivals.own_low_pass import with_own_low_pass
from identify.select.evidence import Evidence
from identify.select.free_form_residual import ON, FreeFormFit
from identify.select.search_state import Found
from rig.dynamics.gains import Noise

SECOND, FIRST = "sensor_lag_second_order", "sensor_lag"
GYRO = [SimpleNamespace(channel="rate", beside=None, torque=object())]
ENCODER = [SimpleNamespace(channel="angle", beside=None, torque=object())]


def fit_with(effects: tuple[str, ...], cost: float, inertia: float) -> Fit:
    names = (("inertia",), ("damping",), *((e, "time") for e in effects))
    x = np.array([inertia, 0.1, *[1e-3 for _ in effects]])
    left = Prediction([], [], [], [])
    return Fit(Structure(effects=effects), names, x, 10_000, 1.0, cost, np.eye(len(x)), Noise(), (), left, 1.5)  # type: ignore[arg-type]


def final(fit: Fit) -> FinalFit:
    covariance = 1e-6 * np.eye(len(fit.names))
    return FinalFit(fit, fit.values, fit.names, covariance, None, False, (True,) * len(fit.names), "prediction error")


def found_with(effects: tuple[str, ...] = ()) -> Found:
    after = final(fit_with(effects, -1000.0, 1.0))
    nothing = cast(Any, None)
    left = Disturbance(0.1, "N*m", 0.01)
    return Found(nothing, final(fit_with((), 0.0, 1.1)), after, left, nothing, nothing, nothing)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What fits with a low-pass gain, on the samples searched and on all; and which one was fitted."""
    seen: dict[str, Any] = {"few": 60.0, "all": 80.0, "form": None}

    def evidence(search: Any, form: str) -> Evidence:
        best = search.best
        richer = fit_with((*best.structure.effects, form), best.cost - seen["few"], 1.0)
        gain = seen["few"] if form == seen.get("likelier", form) else 0.0
        return Evidence(form, richer, gain, 2.0, 0.0, 0.01)

    def on_all(traces: Any, structure: Structure, start: Any, use: Any, like: Fit) -> Any:
        seen["form"] = structure.effects[-1]
        problem = SimpleNamespace(columns_at=lambda *_, **__: [], fit=lambda s, *_: fit_with(s.effects, like.cost, 1.0))
        return problem, fit_with(structure.effects, like.cost - seen["all"], 0.9)

    monkeypatch.setattr(own_low_pass, "_evidence", evidence)
    monkeypatch.setattr(own_low_pass, "fitted_on_all", on_all)
    monkeypatch.setattr(own_low_pass, "inflation", lambda *_: 2.0)
    monkeypatch.setattr(own_low_pass, "as_final", lambda problem, fit, traces, use: final(fit))
    monkeypatch.setattr(open_line, "free_run_of", lambda *_: None)
    monkeypatch.setattr(FinalFit, "is_significant", lambda self, effect: True)
    return seen


def search_with(best: Fit, samples: int = 10_000, **scores: float) -> Any:
    """A search through whose last round looked at the best model, and what that scored."""
    last = SimpleNamespace(now=best, tried={}, scores=[SimpleNamespace(effect=e, gain=g) for e, g in scores.items()])
    return SimpleNamespace(
        best=best, samples=samples, problem=SimpleNamespace(step_s=1e-3, torque_nm=10.0), rounds=[last], left=None,
        doubtful=[],
    )  # fmt: skip


def asked_of(
    found: Found, traces: Any = GYRO, samples: int = 10_000, curves: Sequence[FreeFormFit] = ()
) -> tuple[Found, str]:
    search = search_with(cast(Fit, found.after.fit), samples)
    search.doubtful = list(curves)
    split: Any = SimpleNamespace(final=[], everything=[])
    return with_own_low_pass(found, search, traces, split, lambda text: None)


def test_what_was_found_stays_and_has_the_numbers_beside_the_low_pass(asked: dict[str, Any]) -> None:
    less, note = asked_of(found_with(("torque_delay",)))
    assert asked["form"] == SECOND
    assert less.after.structure.effects == ("torque_delay",)
    assert less.after.values["inertia",] == 0.9
    assert "1.00 ms" in note and "too little of the residual to be named" in note


def test_one_that_takes_the_place_of_an_effect_is_no_property_of_the_gyro(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside a play that innovations follow badly a low-pass of eight samples was likelier; the play had no size."""
    monkeypatch.setattr(FinalFit, "is_significant", lambda self, effect: self.values["inertia",] == 1.0)
    found = found_with(("torque_delay",))
    less, note = asked_of(found)
    assert asked["form"] == SECOND
    assert less is found or less.after is found.after
    assert note == ""


def test_it_is_asked_beside_a_line_that_was_left_open(asked: dict[str, Any]) -> None:
    found = found_with(("torque_delay",))
    search = search_with(fit_with(("torque_delay", "periodic_disturbance"), -1020.0, 1.0))
    split: Any = SimpleNamespace(final=[], everything=[])
    less, note = with_own_low_pass(found, search, cast(Any, GYRO), split, lambda text: None)
    assert asked["form"] == SECOND and note
    assert less.after.structure.effects == ("torque_delay",)
    assert less.after.values["inertia",] == 0.9


def test_beside_a_low_pass_that_is_named_the_other_form_is_asked(asked: dict[str, Any]) -> None:
    asked_of(found_with((SECOND,)))
    assert asked["form"] == FIRST


def test_both_forms_named_leave_nothing_to_ask(asked: dict[str, Any]) -> None:
    found = found_with((SECOND, FIRST))
    assert asked_of(found) == (found, "")


@pytest.mark.parametrize(("few", "everything"), [(10.0, 80.0), (60.0, 10.0)])
def test_where_it_is_not_likelier_nothing_changes(asked: dict[str, Any], few: float, everything: float) -> None:
    asked |= {"few": few, "all": everything}
    found = found_with()
    assert asked_of(found) == (found, "")


def test_few_samples_that_hint_at_it_ask_all_of_a_long_recording(asked: dict[str, Any]) -> None:
    asked["few"] = 10.0
    less, note = asked_of(found_with(), samples=100_000)
    assert note and less.after.values["inertia",] == 0.9


def test_beside_an_encoder_and_where_something_is_left_over_it_is_not_asked(asked: dict[str, Any]) -> None:
    found = found_with()
    left = replace(found.disturbance, depends_on=(Dependence("angle", 0.1, 0.01, 1e-9, (), ()),))
    over = replace(found, disturbance=left)
    assert asked_of(found, ENCODER) == (found, "")
    assert asked_of(over) == (over, "")
    assert asked["form"] is None


@pytest.mark.parametrize(("beside", "taken"), [(None, True), (Dependence("frequency", 0.05, 0.005, 3e-5), False)])
def test_spectral_lines_that_a_low_pass_explains_are_no_torque_that_is_left(
    asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch, beside: Dependence | None, taken: bool
) -> None:
    lines = Dependence("frequency", 0.1, 0.01, 3e-5)
    seen = {True: beside, False: lines}
    monkeypatch.setattr(own_low_pass, "lines_left", lambda fit, torque_nm: seen[SECOND in fit.structure.effects])
    found = found_with((FIRST,))
    found = replace(found, disturbance=replace(found.disturbance, depends_on=(lines,)))
    less, note = asked_of(found)
    assert bool(note) is taken
    assert less.disturbance.depends_on == (() if taken else (lines,))
    assert less.after.values["inertia",] == (0.9 if taken else 1.0)


@pytest.mark.parametrize(
    ("curve", "gain", "taken"),
    [
        ("free_memory", 90.0, True),  # with six parameters: believed less than the low-pass
        ("free_memory", 140.0, False),
        ("free_angle", 90.0, False),  # a low-pass remembers the motion, and nothing about the angle
    ],
)
def test_what_goes_with_past_motion_behind_a_named_lag_is_its_second_stage(
    asked: dict[str, Any], curve: str, gain: float, taken: bool
) -> None:
    left = Dependence(ON[curve], 0.1, 0.01, 1e-9, (), ())
    found = found_with((FIRST,))
    found = replace(found, disturbance=replace(found.disturbance, depends_on=(left,)))
    best = cast(Fit, found.after.fit)
    seen = FreeFormFit(best, Evidence(curve, fit_with((FIRST, curve), 0.0, 1.0), gain, 1.0, 70.0, 0.3), 0.3)
    less, note = asked_of(found, curves=[seen])
    assert bool(note) is taken
    assert less.disturbance.depends_on == (() if taken else (left,))


def test_of_two_forms_the_likelier_is_fitted(asked: dict[str, Any]) -> None:
    asked["likelier"] = FIRST
    _, note = asked_of(found_with(("torque_delay",)))
    assert note and asked["form"] == FIRST


@pytest.mark.parametrize(("score", "fitted"), [(100.0, FIRST), (1.0, None)])
def test_where_the_noise_limits_a_low_pass_without_a_score_is_not_fitted(
    asked: dict[str, Any], score: float, fitted: str | None
) -> None:
    after = found_with(("torque_delay",)).after
    search = search_with(cast(Fit, after.fit), **{FIRST: score, SECOND: 0.5})
    split: Any = SimpleNamespace(final=[], everything=[])
    beside, note = own_low_pass.beside_own_low_pass(after, search, cast(Any, GYRO), split, lambda text: None)
    assert asked["form"] == fitted
    assert (beside.values["inertia",], bool(note)) == ((0.9, True) if fitted else (1.0, False))
