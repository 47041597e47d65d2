"""After a follow-up: which pair is told apart, whether another is worth it, and the errors that stand side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.conclude.next_steps import next_steps
from identify.follow_up.rounds import after_playing, errors_on, is_distinguished, limits_of, promises_more
from identify.follow_up.separation import Imitation, Sensor, Share, prior_of, settled
from identify.follow_up.wording import lines, verdict_sentences
from identify.report.files import result_json
from identify.report.summary import summary
from identify.results import FollowUp, FollowUpPlan, FollowUpRound, Identification, Parting, Unparted
from rig.config.limits import LimitsConfig
from rig.excitation import PlannedSet, Sine
from rig.platform import Platform
from tests.identify.sample import BENT, SIGMA, TRUTH, sample
from tests.identify.simulated import campaign, traces_of

PAIR = ("coulomb_friction", "stribeck_friction")


def verdict(effects: tuple[str, ...], **rivals: tuple[str, ...]) -> Identification:
    found = sample(2.0)[0]
    return replace(found, verdict=replace(found.verdict, effects=effects, confusable_with=rivals))


def plan(separation: float) -> FollowUpPlan:
    return FollowUpPlan({"sets": []}, (Parting(*PAIR, separation),), 12.0, "A slow sine parts them.")


def test_a_pair_is_told_apart_when_one_is_named_and_the_other_no_longer_passes_for_it() -> None:
    assert is_distinguished(verdict(("coulomb_friction",), coulomb_friction=()), *PAIR)
    assert is_distinguished(verdict(("stribeck_friction",), stribeck_friction=("presliding_friction",)), *PAIR)
    assert not is_distinguished(verdict(("coulomb_friction",), coulomb_friction=("stribeck_friction",)), *PAIR)
    assert not is_distinguished(verdict(("cubic_stiffness",), cubic_stiffness=()), *PAIR)


@pytest.mark.parametrize(("second", "worth"), [(900.0, True), (100.0, False)])
def test_a_second_follow_up_has_to_promise_more_than_the_first(second: float, worth: bool) -> None:
    played = FollowUpRound(plan(400.0), (), (PAIR,))
    found = replace(sample(2.0)[0], follow_up=FollowUp(plan(second), rounds=(played,)))
    assert promises_more(found) is worth
    assert promises_more(replace(found, follow_up=FollowUp(plan(30.0))))
    assert not promises_more(replace(found, follow_up=FollowUp(None)))


def test_the_error_of_the_earlier_model_is_taken_on_all_the_data() -> None:
    found, recording = sample(2.0)
    true, bent = (errors_on(model, found, recording) for model in (TRUTH, BENT))
    assert true is not None and bent is not None
    assert true.holdout_rate_rms == pytest.approx(SIGMA, rel=0.1)
    assert bent.holdout_rate_rms is not None and bent.holdout_rate_rms > 10.0 * SIGMA


def test_a_disturbance_has_a_phase_of_its_own_in_runs_that_the_model_has_not_seen() -> None:
    """Its frequency and size were found; that alone must not count against the earlier model."""
    effects = {"periodic_disturbance": {"sine": 0.3, "cosine": 0.4, "frequency": 11.0}}
    recording = campaign(effects, sets=((60.0, 3.0), (40.0, 6.0)), duration_s=2.0)
    shifted = Platform(0.02, 0.045, 677.3, {"periodic_disturbance": {"sine": 0.5, "cosine": 0.0, "frequency": 11.0}})
    errors = errors_on(shifted, sample(2.0)[0], recording)
    assert errors is not None and errors.holdout_rate_rms == pytest.approx(SIGMA, rel=0.2)


def test_what_was_played_stands_in_result_and_summary() -> None:
    first = replace(sample(2.0)[0], follow_up=FollowUp(plan(400.0)))
    newer = verdict(("coulomb_friction",), coulomb_friction=())
    found = after_playing(first, newer, BENT, sample(2.0)[1])
    content = result_json(found)["follow_up"]
    assert content["played"] is True and content["planned"] is None
    assert content["separated"] == [{"effect": PAIR[0], "rival": PAIR[1]}]
    assert content["rounds"][0]["plan"]["file"] == "follow_up.yaml"
    errors = [content["error"][k]["holdout_rate_rms"] for k in ("before", "after", "after_follow_up")]
    assert len(set(errors)) == 3
    said = " ".join(summary(found).split())
    assert "declared model without follow-up after follow-up noise floor" in said
    assert "Coulomb friction and Stribeck friction can be distinguished now." in said


def test_where_the_campaign_was_not_accepted_the_plan_is_what_to_run_next() -> None:
    found = replace(sample(2.0)[0], accepted=False, follow_up=FollowUp(plan(400.0)))
    assert "Play follow_up.yaml." in next_steps(found)


def test_a_plan_and_what_has_none_are_said_in_words() -> None:
    follow_up = FollowUp(
        plan(400.0),
        (
            Unparted("actuator_lag", "sensor_lag", "measure the current"),
            Unparted("backlash", "cogging", "no excitation"),
        ),
        note="it was not played: identify.follow_up is never",
    )
    said = lines(follow_up)
    assert said[0] == "follow_up.yaml (12 s) holds the excitation that the verdict describes."
    assert said[1].startswith("It was not played") and len(said) == 2
    # What can never be told apart the verdict says by itself.
    told = verdict_sentences(follow_up, {"sensor_lag / actuator_lag": "they answer alike"})
    assert [s for s in told if "lag" in s] == []
    assert told[1] == "No follow-up for backlash and cogging: no excitation."


def test_without_limits_in_the_file_those_are_kept_that_the_recording_shows_to_be_borne() -> None:
    found = sample(2.0)[0]
    seen = limits_of(found, LimitsConfig(), False)
    assert seen.torque_nm == pytest.approx(max(abs(t.torque_nm).max() for t in found.traces if t.torque_nm is not None))
    given = limits_of(found, LimitsConfig(travel_deg=3.0, torque_nm=7.0), False)
    assert (given.travel_deg, given.torque_nm, given.rate_deg_s) == (3.0, 7.0, seen.rate_deg_s)
    assert limits_of(found, LimitsConfig(travel_deg=3.0), True).travel_deg == seen.travel_deg  # no degrees on a rail


def test_what_the_data_so_far_know_keeps_a_model_from_giving_way() -> None:
    """J may be anything as far as one new set goes, but not as far as the old ones go."""
    true, heavier = Platform(0.02, 0.045, 677.3), Platform(0.0202, 0.045, 677.3)
    traces = traces_of(replace(campaign(duration_s=1.0), noise=SIGMA))
    prior = prior_of(heavier, traces, SIGMA)
    new = [PlannedSet("new", Sine(torque_nm=20.0, frequency_hz=5.0, duration_s=1.0))]
    sensor = Sensor(1000.0, SIGMA)
    free = settled(Imitation(true, heavier, 0.0 * prior), new, sensor)
    held = settled(Imitation(true, heavier, prior), new, sensor)
    assert free < 1.0
    assert held > 25.0


def test_shares_of_several_sets_add() -> None:
    one = Share(100.0, np.array([10.0]), np.array([[2.0]]))
    assert (one + one).left(np.zeros((1, 1))) == pytest.approx(200.0 - 400.0 / 4.0)
    assert one.left(np.array([[1e9]])) == pytest.approx(100.0)
