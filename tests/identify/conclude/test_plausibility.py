"""Fitted numbers against declared ones: a telling factor is said with its likely cause, all else is silence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from identify.conclude.plausibility import with_declared
from identify.results import Identification
from rig.config.model import ModelConfig
from tests.identify.sample import REFERENCE, UNITS, estimate, sample

GOOD = sample(2.0)[0]
DEGREES = 180.0 / np.pi


def fitted(channel: str = "rate", axis: str = "rotary", **times: float) -> Identification:
    """What is fitted, times some factors, known to a per mille; a term with factor 0 is not there."""
    assert GOOD.after is not None
    values = {n: v * times.get(n, 1.0) for n, v in REFERENCE.items() if times.get(n, 1.0)}
    parameters = {n: estimate(v, 1e-3 * abs(v), UNITS[n]) for n, v in values.items()}
    traces = tuple(replace(t, channel=channel) for t in GOOD.traces)
    return replace(GOOD, after=replace(GOOD.after, parameters=parameters), traces=traces, axis=axis)  # type: ignore[arg-type]


def alike(factor: float) -> dict[str, float]:
    return dict.fromkeys(REFERENCE, factor)


def said(found: Identification, declared: Mapping[str, float] = REFERENCE) -> tuple[str, ...]:
    return tuple(one.sentence for one in with_declared(found, declared).plausibility)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1.0 / DEGREES, "J, C and K are about 1/57 of the declared values, as if the rate were in deg/s"),
        (1.1 * DEGREES, "converted from deg/s"),
        (1000.0, "J, C and K are about 1000 times the declared values, as if the torque were in mN m"),
        (2.0 * np.pi, "turns per second and read as rad/s"),
        (1.0 / 9.81, "the rate were in rpm and read as rad/s, or the torque in kgf m"),
    ],
)
def test_a_factor_that_all_share_is_a_unit_of_torque_or_rate(factor: float, words: str) -> None:
    (sentence,) = said(fitted(**alike(factor)))
    assert words in sentence


def test_a_damping_that_was_a_guess_has_no_veto_and_is_not_named() -> None:
    (sentence,) = said(fitted(inertia=1.0 / DEGREES, stiffness=1.0 / DEGREES))
    assert sentence.startswith("J and K are about 1/57 of the declared values")


def test_an_encoder_is_spoken_of_as_an_angle_and_a_linear_axis_knows_no_degrees() -> None:
    assert "the angle were in degrees" in said(fitted("angle", **alike(1.0 / DEGREES)))[0]
    assert said(fitted(axis="linear", **alike(DEGREES))) == ()
    assert "the motion were in mm" in said(fitted(axis="linear", **alike(1e-3)))[0]


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ({"stiffness": DEGREES}, "K is about 57 times the declared value, while J agrees, as if it were per degree"),
        ({"stiffness": (2 * np.pi) ** 2}, "a frequency in Hz instead of rad/s"),
        ({"inertia": 1e-4}, "J is about 1/10000 of the declared value, while K agrees, as if it were in kg cm^2"),
        ({"stiffness": -1.0}, "K is the opposite of the declared value, while J agrees: check the sign"),
        ({"damping": DEGREES}, "while J and K agree, as if it were per deg/s"),
    ],
)
def test_one_number_beside_others_that_agree_is_a_matter_of_the_declared_one(
    times: dict[str, float], words: str
) -> None:
    (sentence,) = said(fitted(**times))
    assert words in sentence


def test_a_unit_of_time_is_off_by_its_square_in_the_ratio() -> None:
    assert "K/J is about 1/1000000" in said(fitted(inertia=1e3, stiffness=1e-3))[0]
    assert "recorded.scale.time" in said(fitted("angle", inertia=1e6, damping=1e3))[0]


def test_the_only_number_that_was_declared_is_compared_with_the_commonest_factors_alone() -> None:
    only = {"inertia": REFERENCE["inertia"]}
    assert "1/57" in said(fitted(**alike(1.0 / DEGREES)), only)[0]
    assert said(fitted(**alike(2.0 * np.pi)), only) == ()


@pytest.mark.parametrize(
    "times",
    [{}, alike(1.04), alike(3.0), {"inertia": DEGREES}, {"inertia": DEGREES, "stiffness": 1e3}, {"damping": 12.0},
     {"stiffness": 400.0}, alike(75.0)],
)  # fmt: skip
def test_whatever_fits_no_cause_is_silence(times: dict[str, float]) -> None:
    found = fitted(**times)
    assert said(found) == ()
    assert said(found, {}) == ()


@pytest.mark.parametrize("factor", [1.1, 0.8])
def test_a_scale_of_the_torque_is_spoken_of_where_a_known_inertia_would_show_it(factor: float) -> None:
    (sentence,) = said(fitted(**alike(factor)))
    assert "a scale error of the torque" in sentence and "added_inertia_kg_m2" in sentence
    assert said(replace(fitted(**alike(factor)), scale_shows=True)) == ()


def test_a_number_that_the_data_hardly_determine_is_no_evidence() -> None:
    found = fitted(**alike(1.0 / DEGREES))
    assert found.after is not None
    vague = {n: estimate(p.value, 0.2 * p.value, p.unit) for n, p in found.after.parameters.items()}
    assert said(replace(found, after=replace(found.after, parameters=vague))) == ()


def test_torque_with_the_wrong_sign_is_said_by_the_verdict_and_not_twice() -> None:
    turned = tuple(replace(t, torque_nm=-t.torque_nm) for t in GOOD.traces if t.torque_nm is not None)
    assert said(replace(fitted(**alike(1.0 / DEGREES)), traces=turned)) == ()


def test_a_decay_is_compared_by_its_ratios() -> None:
    ratio = REFERENCE["stiffness"] / REFERENCE["inertia"]
    assert GOOD.after is not None
    parameters = {"stiffness_over_inertia": estimate(ratio * (2 * np.pi) ** 2, 1.0, "1/s^2")}
    decay = replace(GOOD, torque_free=True, after=replace(GOOD.after, parameters=parameters))
    assert "Hz instead of rad/s" in said(decay)[0]
    assert with_declared(decay, REFERENCE).declared["stiffness_over_inertia"] == pytest.approx(ratio)


def test_the_finding_is_the_first_sentence_of_the_verdict() -> None:
    found = with_declared(fitted(**alike(1.0 / DEGREES)), REFERENCE)
    assert found.verdict.sentences[0] == found.plausibility[0].sentence
    assert found.plausibility[0].fitted_over_declared == pytest.approx(1.0 / DEGREES)


def test_only_what_somebody_wrote_counts_as_declared() -> None:
    assert ModelConfig().declared_numbers == {}
    model = ModelConfig(inertia_kg_m2=0.02, terms=("inertia", "damping"), stiffness_nm_rad=3.0)
    assert model.declared_numbers == {"inertia": 0.02}
    assert ModelConfig(inertia_kg_m2=0.02, inertia_unknown=True).declared_numbers == {}
    friction = ModelConfig.model_validate({"effects": {"coulomb_friction": {"level_nm": 1.5}}})
    assert friction.declared_numbers == {"coulomb_friction.level": 1.5}
