"""One recording in, one identification out."""

from __future__ import annotations

import inspect
from dataclasses import replace
from functools import cache
from typing import get_type_hints

import numpy as np
import pytest

from identify.conclude.acceptance import interrupted_reason
from identify.pipeline import identify
from identify.report.files import result_json
from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.errors import Aborted, RecordingError
from rig.excitation import Sine
from rig.platform import TERMS, Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, SETS, TRUTH, campaign, decay_run, sine_run, white

FEW = ("coulomb_friction", "cubic_stiffness", "quadratic_damping", "torque_delay")
SETTINGS = IdentifyConfig.model_validate({"candidates": FEW})
FRICTION = IdentifyConfig.model_validate({"candidates": FEW[:1]})
LOW = Platform(0.002, 0.0045, 67.0)
HIGH = Platform(0.2, 0.45, 6773.0)


@cache
def recording(*, friction: bool = True) -> Recording:
    return campaign({"coulomb_friction": {"level": 1.0}} if friction else None, sets=SETS[2:], duration_s=1.5)


@cache
def found_from(declared: str) -> Identification:
    return identify(recording(), {"low": LOW, "high": HIGH}[declared], SETTINGS)


def test_the_identifier_is_handed_a_recording_a_declared_model_its_settings_and_nothing_else() -> None:
    hints = get_type_hints(identify)
    assert list(inspect.signature(identify).parameters) == ["recording", "declared", "settings", "progress"]
    assert hints["recording"] is Recording
    assert hints["declared"] is Platform
    assert hints["settings"] is IdentifyConfig


@pytest.mark.slow
def test_a_spring_that_is_declared_and_not_there_is_left_out_and_the_rest_is_right() -> None:
    platform = (0.02, 0.3, 0.0)
    runs = tuple(sine_run(m, f, jck=platform) for m, f in ((2.0, 0.7), (4.0, 2.0), (8.0, 5.0)))
    found = identify(Recording(runs), Platform(0.02, 0.3, 5.0), SETTINGS)
    assert found.verdict.effects == ()
    assert "stiffness" in [left.name for left in (found.after or found.before).dropped]
    parameters = (found.after or found.before).parameters
    assert parameters["inertia"].value == pytest.approx(0.02, rel=1e-3)
    assert parameters["damping"].value == pytest.approx(0.3, rel=1e-3)


def test_the_hidden_friction_is_named_and_damping_comes_from_far_off_to_within_a_percent() -> None:
    found = found_from("low")
    assert found.accepted, found.reasons
    assert found.verdict.effects == ("coulomb_friction",)
    assert found.after is not None
    assert abs(found.before.parameters["damping"].value / TRUTH[1] - 1) > 1.0
    np.testing.assert_allclose([found.after.parameters[t].value for t in TERMS], TRUTH, rtol=0.01)
    level = found.after.effect_parameters["coulomb_friction"]["level"]
    assert level.value == pytest.approx(1.0, rel=0.005)
    assert level.unit == "N*m"
    assert level.ci95[0] < level.value < level.ci95[1]


def test_the_error_falls_to_the_noise_and_nothing_stays_unexplained() -> None:
    found = found_from("low")
    assert found.after is not None
    assert found.after.error.holdout_rate_rms == pytest.approx(NOISE_RAD_S, rel=0.1)
    assert found.before.error.holdout_rate_rms is not None
    assert found.before.error.holdout_rate_rms > 20 * NOISE_RAD_S
    assert not found.verdict.unexplained


@pytest.mark.slow
def test_declared_models_a_hundred_times_apart_end_at_the_same_numbers() -> None:
    low, high = found_from("low"), found_from("high")
    assert low.verdict.effects == high.verdict.effects
    for term in TERMS:
        assert low.final.parameters[term].value == pytest.approx(high.final.parameters[term].value, rel=1e-9)
        assert low.before.parameters[term].value == pytest.approx(high.before.parameters[term].value, rel=1e-9)


class Untouchable(dict[str, object]):
    """What a recording says of itself, where nobody may look."""

    def __getitem__(self, key: str) -> object:
        raise AssertionError(f"the identifier read {key}")

    get = __contains__ = __iter__ = __getitem__  # type: ignore[assignment]


@cache
def found_without_friction() -> Identification:
    """From a model far off, with the truth in the settings for Eq. 15 and a recording that nobody may ask about it."""
    known = {"inertia_kg_m2": TRUTH[0], "damping_nm_s_rad": TRUTH[1], "stiffness_nm_rad": TRUTH[2]}
    settings = SETTINGS.model_validate(SETTINGS.model_dump() | {"reference": known})
    return identify(replace(recording(friction=False), info=Untouchable()), HIGH, settings)


def test_what_stands_in_info_is_never_read() -> None:
    assert found_without_friction().accepted


def test_where_nothing_is_missing_there_is_no_after() -> None:
    found = found_without_friction()
    assert found.accepted, found.reasons
    assert found.after is None
    assert found.verdict.effects == ()
    for term, truth in zip(TERMS, TRUTH, strict=True):
        estimate = found.final.parameters[term]
        assert abs(estimate.value - truth) < 4.5 * estimate.std_error


@pytest.mark.slow
def test_an_effect_that_is_declared_is_fitted_and_not_named_as_missing() -> None:
    declared = Platform(*TRUTH, effects={"coulomb_friction": {"level": 0.5}})
    found = identify(recording(), declared, SETTINGS)
    assert found.verdict.effects == ()
    assert found.final.effect_parameters["coulomb_friction"]["level"].value == pytest.approx(1.0, rel=0.01)


@pytest.mark.slow
def test_a_torque_that_wanders_at_random_is_no_effect_and_its_size_is_said() -> None:
    runs, wanders, torques = [], [], []
    for i, run in enumerate(recording(friction=False).runs):
        assert run.torque_nm is not None
        wander = np.cumsum(white(len(run.time_s), 0.3, i))
        wander -= np.linspace(0, wander[-1], len(wander))
        wanders.append(wander)
        torques.append(run.torque_nm)
        runs.append(replace(run, torque_nm=run.torque_nm + wander))
    found = identify(Recording(tuple(runs)), LOW, SETTINGS)
    assert found.verdict.effects == ()
    assert not found.accepted
    for term, truth in zip(("inertia", "stiffness"), (TRUTH[0], TRUTH[2]), strict=True):
        assert found.final.parameters[term].value == pytest.approx(truth, rel=0.01)
    share = np.linalg.norm(np.concatenate(wanders)) / np.linalg.norm(np.concatenate(torques))
    assert found.disturbance is not None and found.disturbance.relative == pytest.approx(share, rel=0.3)


def test_a_free_decay_gives_ratios_with_their_units() -> None:
    found = identify(Recording((decay_run(Platform(0.5, 0.1, 20.0)),)), Platform(), SETTINGS)
    assert set(found.final.parameters) == {"damping_over_inertia", "stiffness_over_inertia"}
    stiffness = found.final.parameters["stiffness_over_inertia"]
    assert stiffness.value == pytest.approx(40.0, rel=1e-3)
    assert stiffness.unit == "1/s^2"
    assert found.final.parameters["damping_over_inertia"].value == pytest.approx(0.2, rel=0.02)
    assert found.per_set == ()
    assert found.noise_floor.residual_rms_torque is None


def test_a_torque_of_zeros_is_a_free_decay_too() -> None:
    run = decay_run(Platform(0.5, 0.1, 20.0))
    still = replace(run, torque_time_s=run.time_s, torque_nm=np.zeros(len(run.time_s)))
    assert "stiffness_over_inertia" in identify(Recording((still,)), Platform(), FRICTION).final.parameters


def test_with_a_reference_the_largest_error_of_equation_fifteen_stands_with_every_set() -> None:
    found = found_without_friction()
    assert found.max_error_percent is not None
    for term, truth in zip(TERMS, TRUTH, strict=True):
        errors = [100 * abs(s.parameters[term].value / truth - 1) for s in found.per_set if term in s.parameters]
        assert found.max_error_percent[term] == pytest.approx(max(errors))


def test_a_result_can_be_written_and_a_second_run_repeats_it() -> None:
    rubbing = campaign({"coulomb_friction": {"level": 1.0}}, sets=SETS[3:4], duration_s=1.0)
    first, again = (result_json(identify(rubbing, LOW, FRICTION)) for _ in range(2))
    assert first["after"]["effect_parameters"]["coulomb_friction"]
    assert first["after"] == again["after"]
    assert first["per_set"] == again["per_set"]


@pytest.mark.slow
def test_one_tone_without_its_ring_gives_no_inertia() -> None:
    time = np.arange(8001) * 1e-3
    tone = Sine(torque_nm=111, frequency_hz=0.5, duration_s=8, soft_start_s=2)
    torque = TorqueSignal(time, tone.torque(time))
    rate = simulate(Platform(*TRUTH), time, torque, substeps=16).rate_rad_s + white(len(time), NOISE_RAD_S)
    ok = np.ones(len(time), bool)
    run = Run("soft", time, ok, rate_rad_s=rate, torque_time_s=time, torque_nm=torque.torque_nm, frequency_hz=0.5)
    found = identify(Recording((run,)), LOW, SETTINGS)
    inertia = found.final.parameters.get("inertia")
    assert inertia is None or abs(inertia.value - TRUTH[0]) < 4.5 * inertia.std_error


@pytest.mark.parametrize("fault", ["still", "short", "steady"])
def test_a_recording_without_anything_to_identify_is_refused_with_its_reason(fault: str) -> None:
    time = np.arange(2001) * 1e-3
    run = Run(
        "run", time, np.ones(len(time), bool), rate_rad_s=white(len(time)), torque_time_s=time, torque_nm=np.sin(time)
    )
    said = {"still": "sensor's noise", "short": "40 samples", "steady": "same value"}
    if fault == "short":
        run = replace(run, valid=np.arange(len(time)) < 30)
    if fault == "steady":
        run = replace(run, rate_rad_s=np.sin(9 * time), torque_nm=np.full(len(time), 3.0))
    with pytest.raises(RecordingError, match=said[fault]):
        identify(Recording((run,)), LOW, SETTINGS)


@pytest.mark.parametrize(
    "stop", [Aborted("Stopped by Ctrl-C."), pytest.param(KeyboardInterrupt(), marks=pytest.mark.slow)]
)
def test_who_stops_the_search_gets_what_there_is_and_is_told_so(stop: BaseException) -> None:
    def interrupt(text: str) -> None:
        if text.startswith("added"):
            raise stop

    rubbing = campaign({"coulomb_friction": {"level": 1.0}}, sets=SETS[3:4], duration_s=1.0)
    found = identify(rubbing, LOW, FRICTION, interrupt)
    assert found.aborted
    assert not found.accepted
    assert found.reasons == (interrupted_reason(found.verdict.effects),)
    assert found.per_set == ()
    assert found.before.parameters["stiffness"].value == pytest.approx(TRUTH[2], rel=0.01)


def test_who_stops_before_anything_is_fitted_gets_nothing() -> None:
    def interrupt(text: str) -> None:
        raise Aborted("Stopped by Ctrl-C.")

    with pytest.raises(Aborted):
        identify(campaign(duration_s=2.5), LOW, SETTINGS, interrupt)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "named"), [(1.0, ()), (1.05, ("torque_scale",))])
def test_a_known_added_inertia_tells_the_torque_scale(scale: float, named: tuple[str, ...]) -> None:
    time = np.arange(2501) * 1e-3
    runs = []
    for i, (amplitude, hz, added) in enumerate(((104.0, 3.0, 0.0), (42.0, 9.0, 0.0), (104.0, 3.0, 0.01))):
        torque = TorqueSignal(time, amplitude * np.sin(2 * np.pi * hz * time))
        moved = simulate(Platform(TRUTH[0] + added, *TRUTH[1:]), time, torque, substeps=16).rate_rad_s
        noisy = moved + white(len(time), NOISE_RAD_S, seed=i)
        run = Run(f"run {i}", time, np.ones(len(time), bool), rate_rad_s=noisy, torque_time_s=time,
                  torque_nm=torque.torque_nm / scale, frequency_hz=hz, added_inertia_kg_m2=added)  # fmt: skip
        runs.append(run)
    settings = IdentifyConfig.model_validate({"candidates": ("coulomb_friction", "torque_scale")})
    found = identify(Recording(tuple(runs)), LOW, settings)
    assert found.verdict.effects == named
    assert found.torque_scale is not None
    assert abs(found.torque_scale.value - scale) < 4.5 * found.torque_scale.std_error
    assert found.torque_scale.std_error < 1e-3
    said = " ".join(found.verdict.sentences)
    assert "nothing in these runs can show it" not in said
    assert ("The known added inertia shows" in said) == (not named)
    assert found.accepted, found.reasons
    assert found.set_scatter["stiffness"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_without_damping_that_may_be_there_the_inertia_is_not_told_from_noise(seed: int) -> None:
    """A soft start hardly rings. A model without damping rings on and on, and follows the noise with any inertia."""
    run = sine_run(50.0, 0.5, duration_s=8.0, noise=0.004, seed=seed, soft_s=6.0, jck=(0.02, 0.05, 650.0))
    found = identify(Recording((run,)), Platform(0.02, 0.05, 650.0), SETTINGS)
    assert not found.accepted
    assert "inertia" in {n.name for n in found.final.not_determined}
