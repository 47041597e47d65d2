"""What is left is accepted as long as it is immaterial."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from identify.conclude.acceptance import of_reported, reasons_against_disturbance, reasons_against_fit
from identify.conclude.verdict import residual_torque_sentence
from identify.residual import Dependence, Disturbance
from identify.results import ParameterEstimate
from identify.wording import number
from rig.config.identify import AcceptConfig

RATE = Dependence("rate", 0.03, 0.03, 1e-9)


def test_a_disturbance_that_goes_with_nothing_is_no_reason_however_large() -> None:
    assert reasons_against_disturbance(Disturbance(0.5, "N*m", 0.5), AcceptConfig(), "rotary") == []


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (Disturbance(0.1, "N*m", 0.1, (Dependence("rate", 0.06, 0.06, 1e-9),)), "identify.accept.torque_percent"),
        (Disturbance(0.1, "N*m", 0.1, (RATE,), {"inertia": 2.5}), "identify.accept.inertia_percent"),
        (Disturbance(0.1, "N*m", 0.1, (RATE,), {"damping": 11.0}), "identify.accept.damping_percent"),
    ],
)
def test_each_limit_is_named_where_it_is_passed(left: Disturbance, words: str) -> None:
    (reason,) = reasons_against_disturbance(left, AcceptConfig(), "rotary")
    assert words in reason
    assert "rate" in reason


def test_a_flexible_effect_that_j_hangs_on_is_a_reason_while_something_is_left() -> None:
    moves = {"flexible_mode": {"inertia": 5.8, "damping": 7.9}, "cogging": {"inertia": 0.4}}
    left = Disturbance(0.1, "N*m", 0.1, (RATE,), {}, moves)
    (reason,) = reasons_against_disturbance(left, AcceptConfig(), "rotary")
    assert reason.startswith(
        "flexible mode would change J by 5.8 %, more than is allowed (identify.accept.inertia_percent)"
    )
    assert "identify.accept.inertia_percent" in reason
    unreported = of_reported(left, cast(Any, SimpleNamespace(parameters={"damping": None})))
    assert reasons_against_disturbance(unreported, AcceptConfig(), "rotary") == []


def test_within_all_limits_it_is_accepted_and_told_in_a_sentence() -> None:
    left = Disturbance(0.1, "N*m", 0.1, (RATE,), {"inertia": 1.0, "damping": 5.0})
    assert reasons_against_disturbance(left, AcceptConfig(), "rotary") == []
    assert "3.0 % depends on the rate" in residual_torque_sentence(left, "rotary")
    assert "3.0 % depends on the speed" in residual_torque_sentence(left, "linear")
    assert "changes J by 1.0 % and C by 5.0 %" in residual_torque_sentence(left, "rotary")


def test_a_negative_damping_is_a_reason_of_its_own() -> None:
    def of(damping: float) -> list[str]:
        parameters = {"damping": ParameterEstimate.normal(damping, 0.03, "N*m*s/rad")}
        final = cast(Any, SimpleNamespace(parameters=parameters, not_determined=(), effect_parameters={}))
        return reasons_against_fit((), final)

    assert of(0.05) == of(-0.05) == []
    assert len(of(-2.4)) == 1
    assert "damping C is negative (-2.40 N*m*s/rad)" in of(-2.4)[0]


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "ends"),
    [
        ("torque_scale", "scale", 50.0, True),
        ("torque_scale", "scale", 0.02, True),
        ("torque_scale", "scale", 1.2, False),
        ("sensor_lag", "time", 0.5, True),
        ("torque_delay", "delay", 0.0, False),  # none at all is a value like others
        ("hysteresis", "exponent", 1.0, False),  # so is the end of a shape
    ],
)
def test_what_ends_at_its_limit_is_a_reason(effect: str, parameter: str, value: float, ends: bool) -> None:
    found = {effect: {parameter: ParameterEstimate.normal(value, 0.01, "1")}}
    final = cast(Any, SimpleNamespace(parameters={}, not_determined=(), effect_parameters=found))
    reasons = reasons_against_fit((), final)
    assert [f"ends at {number(value, 3)}" in r for r in reasons] == ([True] if ends else [])


def test_where_an_effect_that_may_be_missing_moves_a_parameter_the_result_is_not_accepted() -> None:
    moves = {"flexible_mode": {"inertia": 33.0, "stiffness": 0.3}}
    (reason,) = reasons_against_disturbance(
        Disturbance(0.01, "N*m", 0.01, moves_without_percent=moves), AcceptConfig(), "rotary"
    )
    assert (
        "without flexible mode the fit would change J by 33 %" in reason and "identify.accept.inertia_percent" in reason
    )
    assert "K by" not in reason
