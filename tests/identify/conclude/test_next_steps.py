"""A campaign that was not accepted says what to run next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.conclude.acceptance import interrupted_reason, unexplained_reason
from identify.conclude.next_steps import next_steps
from identify.diagnose.torque_residual import dependence
from identify.report.files import result_json
from identify.report.page import report_html
from identify.report.summary import summary
from identify.residual import Dependence, Disturbance, FreeLine, ResidualDiagnosis, Share
from identify.results import Identification, NotReported, RunTraces
from tests.identify.sample import sample, unhappy
from tests.identify.simulated import white

FOUND, RECORDING = sample(2.0)
LOST = replace(FOUND, accepted=False, verdict=replace(FOUND.verdict, unexplained=True, unexplained_fraction=0.4))


def with_rest(found: Identification, rest: str) -> Identification:
    """What is left made a function of one quantity, with noise."""

    def of(t: RunTraces) -> np.ndarray:
        shapes = {
            "rate": np.sign(t.rate_rad_s),
            "angle": 1e3 * t.angle_rad**3,
            "torque": 2e-6 * np.asarray(t.torque_nm) ** 3,
            "time": t.time_s * white(len(t.time_s), seed=7),
            "": white(len(t.time_s), seed=8),
        }
        return shapes[rest] + white(len(t.time_s), 0.1)

    return replace(found, traces=tuple(replace(t, torque_residual_after=of(t)) for t in found.traces))


def test_an_accepted_campaign_needs_no_next_step() -> None:
    assert next_steps(FOUND) == ()


@pytest.mark.parametrize(
    ("rest", "words"),
    [("rate", "ramp_hold_release"), ("time", "drifts"), ("", "multisine")],
)
def test_the_step_follows_from_what_the_rest_goes_with(rest: str, words: str) -> None:
    (step,) = next_steps(with_rest(LOST, rest))
    assert words in step


@pytest.mark.parametrize("rest", ["rate", "angle", "torque", "time", ""])
def test_a_recorded_file_is_not_told_of_keys_that_it_does_not_have(rest: str) -> None:
    keys = ("ramp_hold_release", "repeat_scales", "soft_start_s", "rig check")
    lost = with_rest(LOST, rest)
    assert not any(key in step for step in next_steps(replace(lost, recorded=True)) for key in keys)
    assert FOUND.after is not None
    open_ = replace(FOUND, accepted=False, recorded=True, after=replace(
        FOUND.after, not_determined=(NotReported("damping", "no information"),)))  # fmt: skip
    (step,) = next_steps(open_)
    assert "starts abruptly" in step or "start abruptly" in step
    assert not any(key in step for key in keys)


def test_the_step_follows_the_dependence_that_the_verdict_speaks_of() -> None:
    on_angle = Disturbance(
        1.0, "N*m", 0.07, (Dependence("rate", 0.3, 0.02, 1e-6), Dependence("angle", 0.9, 0.06, 1e-6))
    )
    (step,) = next_steps(replace(with_rest(LOST, "torque"), disturbance=on_angle))
    assert step.startswith("To separate spring, backlash, cogging and gravity")
    past = Disturbance(1.0, "N*m", 0.07, (Dependence("history", 0.9, 0.06, 1e-6),))
    (step,) = next_steps(replace(with_rest(LOST, "torque"), disturbance=past))
    assert step.startswith("To separate hysteresis, creep")


def test_a_line_that_the_diagnosis_found_is_what_the_step_goes_after() -> None:
    line = ResidualDiagnosis("torque", "N*m", 9.0, None, (FreeLine(49.98, 0.3, 3),), None, None)
    lost = with_rest(LOST, "")
    (step,) = next_steps(replace(lost, residual_after=line))
    assert "49.98 Hz" in step and "drive off" in step
    of_memory = replace(line, free_lines=(), memory=Share(0.4, 0.01))
    (step,) = next_steps(replace(lost, residual_after=of_memory))
    assert step.startswith("To separate hysteresis, creep")


def test_who_stopped_the_search_is_told_what_was_proven_and_to_identify_again() -> None:
    reason = interrupted_reason(("coulomb_friction", "torque_delay"))
    assert "after Coulomb friction and torque delay was proven" not in reason
    assert "Coulomb friction and torque delay were proven" in reason
    assert "missing effects are not yet determined" in interrupted_reason(())
    stopped = replace(LOST, aborted=True, reasons=(reason,))
    (step,) = next_steps(stopped)
    assert step.startswith("Identify this recording again") and "play it again" not in step


def test_a_run_that_begins_in_motion_is_said_to_hide_what_remembers() -> None:
    found = with_rest(LOST, "rate")
    first, *others = found.traces
    late = replace(first, rate_rad_s=np.roll(first.rate_rad_s, -300))
    steps = next_steps(replace(found, traces=(late, *others)))
    assert len(steps) == 2
    assert "starts in motion" in steps[0] and first.name in steps[0]


def test_a_decay_is_not_told_to_raise_its_torque() -> None:
    found = with_rest(LOST, "")
    free = replace(found, traces=tuple(replace(t, torque_nm=None) for t in found.traces))
    lost = replace(
        free, before=replace(free.before, not_determined=(NotReported("damping", "too little"),)), after=None
    )
    steps = next_steps(lost)
    assert len(steps) == 2 and all("release" in step and "soft_start" not in step for step in steps)


@pytest.mark.parametrize(("rest", "words"), [("rate", "smaller angle"), ("angle", "both ends"), ("time", "drifts")])
def test_without_a_motor_the_step_is_a_release_whatever_the_rest_goes_with(rest: str, words: str) -> None:
    def of(t: RunTraces) -> RunTraces:
        values = {
            "rate": np.sign(t.rate_rad_s), "angle": 1e3 * t.angle_rad**3,
            "time": t.time_s * white(len(t.time_s), seed=7),
        }[rest]  # fmt: skip
        left = t.measured - values - white(len(t.time_s), 0.1)
        return replace(t, torque_nm=None, torque_residual_after=None, simulated_after=left)

    (step,) = next_steps(replace(LOST, traces=tuple(of(t) for t in LOST.traces[4:])))
    assert words in step and f"depends on the {rest}" in step
    assert "torque" not in step and "play" not in step and "ramp_hold_release" not in step


def test_a_linear_axis_is_spoken_of_in_its_own_words() -> None:
    (step,) = next_steps(replace(with_rest(LOST, "rate"), axis="linear"))
    assert "depends on the speed" in step
    assert "half of its force" in step


@pytest.mark.parametrize("rest", ["rate", "angle", "torque", "time"])
def test_the_quantity_that_the_rest_goes_with_comes_first(rest: str) -> None:
    traces = with_rest(LOST, rest).traces[4:]  # at 9 Hz angle and torque differ by the ring
    shares = dependence(traces, 100.0)
    assert next(iter(shares)) == rest or shares[rest] > 0.9 * max(shares.values())


def test_white_noise_goes_with_nothing() -> None:
    assert max(dependence(with_rest(LOST, "").traces, 100.0).values()) < 0.02


def test_opposite_signs_are_said_alone_since_all_else_follows_from_them() -> None:
    turned = tuple(replace(t, torque_nm=-t.torque_nm) for t in LOST.traces if t.torque_nm is not None)
    (step,) = next_steps(replace(LOST, traces=turned))
    assert "opposite sign conventions" in step
    assert "recorded.scale.torque" in step


def test_a_parameter_that_is_not_determined_gets_a_set_that_determines_it() -> None:
    assert FOUND.after is not None
    final = replace(FOUND.after, not_determined=(NotReported("damping", "no information"),))
    (step,) = next_steps(replace(FOUND, accepted=False, after=final))
    assert step.startswith("To determine damping: add a set at another frequency")


def test_a_search_that_stopped_early_is_told_from_a_model_that_cannot_reach_the_level() -> None:
    assert FOUND.joint is not None
    assert FOUND.joint.closed_form_objective is not None
    early = replace(FOUND.joint, accepted=False)
    (step,) = next_steps(replace(FOUND, accepted=False, joint=early))
    assert "generations" in step
    hopeless = replace(early, j_dec=0.9 * FOUND.joint.closed_form_objective)
    (step,) = next_steps(replace(FOUND, accepted=False, joint=hopeless))
    assert "more generations do not help" in step


def test_summary_report_and_result_say_the_same_step() -> None:
    lost = with_rest(LOST, "rate")
    (step,) = next_steps(lost)
    assert result_json(lost)["next"] == [step]
    assert step in " ".join(summary(lost, width=400).split())
    assert step.split(". ", 1)[1][:60] in report_html(lost, RECORDING, "x")


@pytest.mark.parametrize("found", [LOST, unhappy(), replace(unhappy(), traces=())])
def test_whatever_went_wrong_there_is_a_next_step(found: Identification) -> None:
    assert next_steps(found)


def test_what_is_left_is_said_in_percent_of_the_torque_as_well() -> None:
    assert FOUND.after is not None
    error = replace(FOUND.after.error, holdout_torque_relative=0.0327)
    told = unexplained_reason(909.2**2, replace(FOUND, after=replace(FOUND.after, error=error)))
    assert "3.3 % of the torque (909 times the sensor's noise, which is included)" in told
    linear = unexplained_reason(909.2**2, replace(FOUND, axis="linear", after=replace(FOUND.after, error=error)))
    assert "of the force" in linear
