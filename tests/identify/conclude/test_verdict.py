"""The verdict in sentences."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.conclude.conclusion import inseparable
from identify.conclude.verdict import sentences_of
from identify.model.structure import Structure
from identify.report.summary import summary
from identify.residual import Dependence, Disturbance
from identify.results import TAKEN_BACK, Candidate, NotReported
from rig import effects
from tests.identify.sample import estimate, sample

FOUND, _ = sample(2.0)


def test_each_effect_is_named_with_its_numbers_and_units_in_the_order_of_finding() -> None:
    first, second, *_ = sentences_of(FOUND)
    assert "Coulomb friction" in first
    assert "N·m" in first
    assert "torque delay" in second
    assert "0.6003 ms)" in second


def test_what_the_missing_effect_did_to_each_parameter_is_said_with_its_direction() -> None:
    said = " ".join(sentences_of(FOUND))
    assert "Without Coulomb friction and torque delay in the model, rotary inertia J is" in said
    assert "damping C is about 9.2 times too high" in said


def test_a_term_that_was_dropped_is_named_where_nothing_was_added() -> None:
    assert FOUND.after is not None
    dropped = replace(FOUND.after, dropped=(NotReported("stiffness", "it came out negative"),))
    said = sentences_of(replace(FOUND, verdict=replace(FOUND.verdict, effects=()), after=dropped))
    assert any(s.startswith("With stiffness in the model, ") for s in said)


def test_of_two_wrong_models_neither_is_said_to_have_bent_the_other() -> None:
    verdict = replace(FOUND.verdict, effects=(), unexplained=True)
    assert not any("in the model," in s for s in sentences_of(replace(FOUND, verdict=verdict)))


def test_a_rival_is_named_with_what_would_separate_it() -> None:
    verdict = replace(FOUND.verdict, confusable_with={"coulomb_friction": ("stribeck_friction",)})
    said = sentences_of(replace(FOUND, verdict=verdict))[0]
    assert "cannot exclude Stribeck friction" in said
    assert "ramp slowly" in said


def test_opposite_signs_are_the_first_thing_said() -> None:
    turned = tuple(replace(t, torque_nm=-t.torque_nm) for t in FOUND.traces if t.torque_nm is not None)
    first, *_ = sentences_of(replace(FOUND, accepted=False, traces=turned))
    assert first.startswith("Torque and rate have opposite sign conventions")
    assert not any("sign conventions" in s for s in sentences_of(replace(FOUND, accepted=False)))


def test_a_scale_of_the_torque_that_nothing_speaks_for_is_not_spoken_of() -> None:
    assert not any("scale error" in s or "added_inertia" in s for s in sentences_of(FOUND))


def test_nothing_found_is_said_as_plainly_whether_the_floor_is_reached_or_not() -> None:
    empty = replace(FOUND.verdict, effects=(), unexplained=False)
    assert "reaches the noise floor" in sentences_of(replace(FOUND, verdict=empty, after=None))[0]
    lost = replace(empty, unexplained=True, unexplained_fraction=0.42)
    said = sentences_of(replace(FOUND, verdict=lost, after=None))
    assert "no candidate explains" in said[0]
    assert any("42 %" in s for s in said)
    left = Disturbance(0.1, "N*m", 0.001)
    for disturbance, on in (
        (left, "no quantity that was tested"),
        (replace(left, depends_on=(Dependence("angle", 0.1, 0.001, 1e-6),)), "the angle"),
    ):
        accepted = replace(FOUND, verdict=lost, after=None, accepted=True, disturbance=disturbance)
        assert any(f"unexplained; it depends on {on}." in s for s in sentences_of(accepted))
    refused = replace(FOUND, verdict=lost, after=None, accepted=False)
    assert any("the plots show what it depends on" in s for s in sentences_of(refused))


def test_of_what_was_found_and_taken_back_it_is_not_said_that_it_explains_little() -> None:
    back = Candidate("cubic_stiffness", 1, -500.0, None, TAKEN_BACK)
    empty = replace(FOUND.verdict, effects=(), unexplained=True, candidates=(back,))
    said = sentences_of(replace(FOUND, verdict=empty, after=None))[0]
    assert said == (
        "No effect is named: cubic stiffness explained part of the residual, but no better than an arbitrary curve or "
        "a model with fewer terms."
    )


def test_a_scale_that_was_found_is_said_with_what_it_means() -> None:
    scaled = replace(FOUND, scale_shows=True, torque_scale=estimate(1.07, 0.001, "1"))
    (said,) = [s for s in sentences_of(scaled) if "1.0700" in s]
    assert "larger or smaller by the same factor" in said


def test_without_torque_there_is_no_scale_to_speak_of() -> None:
    assert FOUND.after is not None
    names = {"damping": "damping_over_inertia", "stiffness": "stiffness_over_inertia"}
    ratios = {names[k]: v for k, v in FOUND.after.parameters.items() if k in names}
    said = sentences_of(replace(FOUND, after=replace(FOUND.after, parameters=ratios)))
    assert not any("scale" in s for s in said)


@pytest.mark.parametrize(("travel_deg", "told"), [(9.0, True), (57.0, False)])
def test_gravity_and_a_bent_spring_are_inseparable_in_small_swings_alone(travel_deg: float, told: bool) -> None:
    never = inseparable(Structure(effects=("unbalance", "actuator_lag")), travel_deg)
    assert ("unbalance / cubic_stiffness" in never) == ("unbalance / quadratic_stiffness" in never) == told
    assert "actuator_lag / sensor_lag" in never


def test_without_a_spring_a_lag_and_the_platform_may_be_exchanged() -> None:
    numbers = {"inertia": estimate(4e-4, 1e-6), "damping": estimate(0.02, 1e-4, "N*m*s/rad")}
    lag = {"sensor_lag": {"time": estimate(0.4, 1e-3, "s")}}
    after = replace(FOUND.after, parameters=numbers, effect_parameters=lag)
    (said,) = [s for s in sentences_of(replace(FOUND, after=after)) if "may be exchanged" in s]
    assert "rotary inertia J of 0.00800 kg·m² beside a lag of 20.0 ms fits as well" in said
    bent = {**lag, "coulomb_friction": {"level": estimate(1.0, 0.01, "N*m")}}
    short = {"sensor_lag": {"time": estimate(4e-4, 1e-6, "s")}}
    spring = {**numbers, "stiffness": estimate(600.0, 1.0, "N*m/rad")}
    others = (
        replace(after, effect_parameters=bent),
        replace(after, effect_parameters=short),
        replace(after, parameters=spring),
        replace(after, effect_parameters={"sensor_lag": {}}),  # its time is not determined
    )
    for other in others:
        assert not any("may be exchanged" in s for s in sentences_of(replace(FOUND, after=other)))


def test_what_can_never_be_told_apart_is_said_with_the_reason() -> None:
    verdict = replace(FOUND.verdict, never_separable={"actuator_lag / sensor_lag": "they answer alike"})
    said = sentences_of(replace(FOUND, verdict=verdict))[-1]
    assert "cannot be separated" in said
    assert "they answer alike" in said


def test_a_parameter_that_is_known_badly_is_said_with_what_would_tell_it() -> None:
    assert FOUND.after is not None
    assert not any("Poorly determined" in s for s in sentences_of(FOUND))
    wide = replace(FOUND.after, parameters={**FOUND.after.parameters, "inertia": estimate(0.02, 0.002)})
    said = [s for s in sentences_of(replace(FOUND, after=wide)) if "Poorly determined" in s]
    assert said[0].startswith("Poorly determined: rotary inertia J ± 20 %. To determine inertia: add a set at another")
    assert not any("Poorly determined" in s for s in sentences_of(replace(FOUND, after=wide, accepted=False)))


@pytest.mark.parametrize("missing", [(), ("inertia",), ("damping",), ("stiffness",), ("damping", "stiffness")])
def test_whatever_the_runs_leave_open_has_its_sentences(missing: tuple[str, ...]) -> None:
    """What is not determined is left out of the tables, and nothing may look it up there."""
    assert FOUND.after is not None
    terms = {k: v for k, v in FOUND.after.parameters.items() if k not in missing}
    for name in effects.names():
        after = replace(FOUND.after, parameters=terms, effect_parameters={name: {}}, platform=None)
        verdict = replace(FOUND.verdict, effects=(name,), confusable_with={name: ()}, contribution={}, rival_models={})
        said = sentences_of(found := replace(FOUND, after=after, verdict=verdict))
        assert said and all(said)
        assert summary(found)
