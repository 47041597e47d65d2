"""The search on measured data: what carries the torque that is left is named, and nothing besides."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.proof.rigs import campaign, config_of, fitted, sized
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.final_fit import FinalFit
from identify.estimate.initial_guess import Start, scale_of
from identify.likelihood.by_prediction_error import fitted_on_all
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.results import Dependence, Disturbance, Identification
from identify.runs.holdout import split
from identify.select import field_search
from identify.select.field_search import Judged, _final, search_in_torque
from identify.select.search_state import Found, Search
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from tests.identify.servo import Servo
from tests.identify.simulated import traces_of

DECLARED = Platform(1e-3, 1e-3, 1.0)


FEW = ("coulomb_friction", "torque_offset", "directional_damping", "torque_delay")
OFFERED = pytest.mark.parametrize("offered", [FEW, pytest.param(None, marks=pytest.mark.slow)])  # None: the library


def test_terms_that_two_curves_move_keep_their_order_from_run_to_run() -> None:
    first = Dependence("angle", 1.0, 0.1, 0.0, (0.0,), (1.0,))
    left = Disturbance(2.0, "N m", 0.2, (first,), {"damping": 1.0, "inertia": 2.0})
    both = left.with_free_form(Dependence("rate", 1.5, 0.1, 0.0, (0.0,), (1.0,)), {"stiffness": 4.0, "inertia": 3.0})
    assert list(both.moves_percent.items()) == [("damping", 1.0), ("inertia", 3.0), ("stiffness", 4.0)]


@cache
def found_in(servo: Servo, offered: tuple[str, ...] | None = None) -> Identification:
    return identify(servo.recording(2), DECLARED, IdentifyConfig(candidates=offered))


class Hidden(dict[str, dict[str, float]]):
    """Effects that a cache can hold."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(sorted((k, tuple(sorted(v.items()))) for k, v in self.items())))


PLAIN = Servo()
RUBBING = Servo(effects=Hidden(coulomb_friction={"level": 0.02}))
TILTED = Servo(effects=Hidden(coulomb_friction={"level": 0.02}, torque_offset={"level": 0.01}))


def right(found: Identification, servo: Servo) -> None:
    """Inertia is right, and a spring that is not there is not claimed."""
    assert found.final.parameters["inertia"].value == pytest.approx(servo.inertia, rel=0.01)
    assert "stiffness" not in found.final.parameters
    assert found.accepted


@OFFERED
def test_a_servo_with_nothing_hidden_is_accepted_and_nothing_is_named(offered: tuple[str, ...] | None) -> None:
    found = found_in(PLAIN, offered)
    assert found.verdict.effects == ()
    assert found.disturbance is not None
    assert found.disturbance.relative == pytest.approx(0.008, rel=0.8)
    right(found, PLAIN)


@pytest.mark.slow
@OFFERED
def test_coulomb_friction_of_a_servo_is_named_alone_and_what_is_left_is_told(offered: tuple[str, ...] | None) -> None:
    found = found_in(RUBBING, offered)
    assert found.verdict.effects == ("coulomb_friction",)
    assert found.final.effect_parameters["coulomb_friction"]["level"].value == pytest.approx(0.02, rel=0.05)
    assert found.final.error.holdout_measure == "holdout_torque_relative"
    assert any(s.startswith("The final model leaves a residual torque of") for s in found.verdict.sentences)
    right(found, RUBBING)


@pytest.mark.slow
def test_friction_and_a_constant_torque_are_both_named() -> None:
    found = found_in(TILTED)
    assert set(found.verdict.effects) == {"coulomb_friction", "torque_offset"}
    assert found.verdict.explained_fraction > 0.9
    right(found, TILTED)


def test_where_the_likelihood_leaves_a_multiple_the_numbers_of_least_squares_are_reported() -> None:
    traces = traces_of(RUBBING.recording(2))
    parts, structure = split(traces, "auto"), Structure(("inertia", "damping")).plus("coulomb_friction")
    regression = TorqueRegression(traces, parts, 20.0, scale_of(traces, (RUBBING.inertia, 1e-3, 0.0), ()))
    least = regression.solve(structure, {})
    problem, right_one = fitted_on_all(traces, structure, least.values, parts.final)
    level = ("coulomb_friction", "level")
    wrong = {**right_one.values, level: 0.4 * right_one.values[level]}
    held = problem.fit(structure, wrong, right_one.noise, fixed=tuple(wrong))
    for fit, by in ((right_one, "prediction error"), (held, "least squares in torque")):
        final = _final(regression, least, (problem, fit), traces, parts, trusted=True)
        assert final.method == by
        assert final.values[level] == pytest.approx(0.02, rel=0.05)


@pytest.mark.slow
def test_shapes_of_a_declared_effect_are_those_of_the_likelihood_also_where_torque_cannot_follow_it() -> None:
    """A hysteresis cannot be followed along the measured motion; in torque its shapes had stayed as declared."""
    rng = np.random.default_rng([3, *b"hysteresis"])
    true = sized("hysteresis", float(rng.uniform(0.02, 0.05)), rng)
    recording = campaign(config_of({"hysteresis": true}, 3), 3)
    found = fitted(recording, "hysteresis", {k: float(v * rng.uniform(0.8, 1.2)) for k, v in true.items()})
    assert found.final.platform is not None
    assert found.final.platform.effects["hysteresis"] == pytest.approx(true, rel=0.01)
    assert found.final.platform.inertia_kg_m2 == pytest.approx(0.0203, rel=1e-3)


def test_what_is_left_of_a_model_found_in_torque_is_the_likelihoods_where_that_has_found_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Dropped down to the likelihood's own model, it was least squares': a damping 12 % off where a limit bends it."""
    traces = traces_of(TILTED.recording(2))
    parts, declared = split(traces, "auto"), Structure(("inertia", "damping"))
    own = declared.plus("coulomb_friction")
    regression = TorqueRegression(traces, parts, 20.0, scale_of(traces, (TILTED.inertia, 1e-3, 0.0), ()))
    _, fit = fitted_on_all(traces, own, regression.solve(own, {}).values, parts.final)
    search: Any = SimpleNamespace()
    trusted: list[tuple[tuple[str, ...], bool]] = []

    def final(*args: Any, **options: Any) -> Any:
        found = _final(*args, **options)
        trusted.append((found.structure.effects, options["trusted"]))
        return found

    def unsupported(fit: FinalFit, *_: Any) -> str | None:
        return "torque_offset" if "torque_offset" in fit.structure.effects else None

    better = (("_final", final), ("_unsupported", unsupported), ("leaves_less", lambda *_: True))
    for name, by in (*better, ("is_more_flexible", lambda *_: False)):
        monkeypatch.setattr(field_search, name, by)
    start = Start((TILTED.inertia, 1e-3, 0.0), 1.0, 20.0)
    search_in_torque(
        traces, parts, declared, {}, start, ("coulomb_friction", "torque_offset"),
        "N*m", lambda _: None, Judged(fit, search), False, regression,
        lambda structure, values: "torque_offset" not in structure.effects,
    )  # fmt: skip
    assert trusted[-1] == (("coulomb_friction",), True)


def looked_in_torque(own: Structure, values: dict[Any, float], trusted: bool, better: bool) -> Found:
    """What a search in torque makes of the likelihood's model of a tilted servo."""
    traces = traces_of(TILTED.recording(2))
    parts, declared = split(traces, "auto"), Structure(("inertia", "damping"))
    regression = TorqueRegression(traces, parts, 20.0, scale_of(traces, (TILTED.inertia, 1e-3, 0.0), ()))
    begin = {**regression.solve(declared, {}).values, **values}
    _, fit = fitted_on_all(traces, own, begin, parts.final)
    search = Search(regression.solve(declared, {}), fit, 1.0, 0.0, contribution={"coulomb_friction": 1.0})
    return search_in_torque(
        traces, parts, declared, {}, Start((TILTED.inertia, 1e-3, 0.0), 1.0, 20.0), FEW, "N*m", lambda _: None,
        Judged(fit, search), trusted, regression, lambda structure, values: not better,
    )  # fmt: skip


def test_what_a_search_in_torque_finds_stands_beside_the_low_pass_that_the_likelihood_has_found() -> None:
    """A low-pass of the sensor had kept everybody from looking in torque: friction and offset went unnamed."""
    own = Structure(("inertia", "damping")).plus("sensor_lag")
    found = looked_in_torque(own, {("sensor_lag", "time"): 0.002}, trusted=False, better=True)
    assert set(found.named) == {"sensor_lag", "coulomb_friction", "torque_offset"}
    assert set(found.search.best.structure.effects) == set(found.named)
    assert found.after.values["coulomb_friction", "level"] == pytest.approx(0.02, rel=0.05)
    assert set(found.before.structure.effects) == set()


def test_where_torque_cannot_follow_a_model_it_says_nothing_of_what_its_effects_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Near a resonance with little damping the errors of the motion drown the torque: a true spring was taken back."""
    monkeypatch.setattr(field_search, "in_band", lambda *_: 0.0)  # the likelihood leaves next to nothing
    own = Structure(("inertia", "damping")).plus("coulomb_friction")
    found = looked_in_torque(own, {("coulomb_friction", "level"): 0.02}, trusted=True, better=False)
    assert found.named == ["coulomb_friction"]
    assert found.search.contribution == {}
