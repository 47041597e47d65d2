"""The plan of a follow-up: what parts two models that the record leaves alike, and when there is nothing to plan."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blind.excitations import read
from identify.bounds.cramer_rao import planned_trace
from identify.follow_up.choice import GOOD, MIN_CHI_SQUARE
from identify.follow_up.pairs import free_run, never_reason
from identify.follow_up.planner import plan_follow_up, with_follow_up
from identify.follow_up.wording import follow_up_yaml
from identify.results import FollowUp, FollowUpPlan, Identification
from rig.config.excitation import ExcitationConfig
from rig.config.load import load_config
from rig.excitation import PlannedSet, planned
from rig.platform import Platform
from rig.preflight import Peaks, predict
from rig.recording.run import Recording
from tests.identify.confusable import NOISE_RAD_S, confused, fitted
from tests.identify.simulated import traces_of

ALLOWED = Peaks(9.5, 380.0, 330.0)
RATE_HZ = 500.0
PAIRS = {
    "coulomb_friction": (
        {"stribeck_friction": {"coulomb": 0.3, "static": 0.306, "speed": 0.01}}, {"coulomb_friction": {"level": 0.3}}
    ),
    "cubic_stiffness": ({"backlash": {"half_gap": 8e-6}}, {"cubic_stiffness": {"factor": 20.0}}),
    "actuator_lag": ({"torque_delay": {"delay": 0.0005}}, {"actuator_lag": {"time": 0.0005}}),
}  # fmt: skip
NEVER = {
    "sensor_lag": ({"actuator_lag": {"time": 0.001}}, {"sensor_lag": {"time": 0.001}}),
    "unbalance": (
        {"quadratic_stiffness": {"factor": 50.0}}, {"unbalance": {"sine": 1.0, "cosine": -90.0}}
    ),
}  # fmt: skip

# Each pair is planned once, which takes seconds.
EACH_PAIR = pytest.mark.parametrize(
    "rival", [pytest.param("coulomb_friction", marks=pytest.mark.slow), *list(PAIRS)[1:]]
)

RECORDS = {"cubic_stiffness": (10.0, 40.0, 1.0)}  # torque, frequency, duration: no harmonic of it comes near resonance


@cache
def case(rival: str) -> tuple[Identification, Recording]:
    true, passed = {**PAIRS, **NEVER}[rival]
    return confused(true, passed, *RECORDS.get(rival, (60.0, 3.0, 3.0)))


@cache
def planned_for(rival: str) -> FollowUp:
    found = plan_follow_up(*case(rival), ALLOWED, RATE_HZ, 12.0)
    assert found is not None
    return found


def plan_for(rival: str) -> FollowUpPlan:
    plan = planned_for(rival).plan
    assert plan is not None
    return plan


def sets_of(plan: FollowUpPlan) -> tuple[PlannedSet, ...]:
    return planned(ExcitationConfig.model_validate(dict(plan.excitation)).sets)


def models_of(rival: str) -> tuple[Platform, Platform]:
    found, _ = case(rival)
    assert found.final.platform is not None
    return found.final.platform, next(iter(found.verdict.rival_models.values()))[rival]


@pytest.mark.slow
@EACH_PAIR
def test_a_pair_that_the_record_leaves_alike_gets_a_plan_within_a_minute_of_torque(rival: str) -> None:
    plan = plan_for(rival)
    (parting,) = plan.partings
    assert parting.rival == rival and parting.separation > MIN_CHI_SQUARE
    assert plan.duration_s < 60.0
    assert rival.split("_", maxsplit=1)[0] in plan.why.lower()


@pytest.mark.parametrize("rival", [pytest.param(r, marks=pytest.mark.slow) for r in list(PAIRS)[:2]] + list(PAIRS)[2:])
def test_a_rival_fitted_to_all_the_data_misses_them_by_what_was_promised(rival: str) -> None:
    """The promise is kept where it counts: the rival adapts to the old record and the new one, and fails."""
    named, passed = models_of(rival)
    _, recording = case(rival)
    rng = np.random.default_rng(7)
    new = []
    for one in sets_of(plan_for(rival)):
        run = planned_trace(named, one, RATE_HZ, NOISE_RAD_S).run
        assert run.rate_rad_s is not None
        new.append(replace(run, rate_rad_s=run.rate_rad_s + NOISE_RAD_S * rng.standard_normal(len(run.time_s))))
    together = replace(recording, runs=(*recording.runs, *new))
    before = chi_square(passed, recording) - chi_square(named, recording)
    after = chi_square(fitted(passed, together), together) - chi_square(fitted(named, together), together)
    assert before < MIN_CHI_SQUARE < after
    assert after > 0.3 * min(plan_for(rival).partings[0].separation, GOOD)


def chi_square(platform: Platform, recording: Recording) -> float:
    traces = traces_of(recording)
    return free_run(platform, traces).sigma ** 2 * sum(t.count for t in traces) / NOISE_RAD_S**2


@EACH_PAIR
def test_every_set_stays_within_the_limits_on_both_models(rival: str) -> None:
    for one in sets_of(plan_for(rival)):
        assert all(predict(model, one, ALLOWED).passes for model in models_of(rival))


def test_another_amplitude_parts_backlash_from_cubic_stiffness() -> None:
    """The record has one amplitude, at which a cube is as good as a gap."""
    _, recording = case("cubic_stiffness")
    rate = recording.runs[0].rate_rad_s
    assert rate is not None
    recorded_deg = np.degrees(np.max(np.abs(rate))) / (2.0 * np.pi * 40.0)
    caps = [entry["travel_cap_deg"] for entry in plan_for("cubic_stiffness").excitation["sets"]]
    assert all(cap > 2.0 * recorded_deg or cap < 0.5 * recorded_deg for cap in caps)


def test_high_frequencies_part_a_delay_from_a_lag() -> None:
    entries = plan_for("actuator_lag").excitation["sets"]
    assert max(entry.get("frequency_hz", entry.get("to_hz", 0.0)) for entry in entries) > 20.0


@pytest.mark.parametrize("rival", NEVER)
def test_for_what_no_torque_and_rate_can_part_nothing_is_planned(rival: str) -> None:
    follow_up = planned_for(rival)
    assert follow_up.plan is None
    assert "turn the base" in follow_up.unparted[0].reason or "second sensor" in follow_up.unparted[0].reason


def test_gravity_and_a_bent_spring_are_planned_for_where_the_travel_allowed_parts_them() -> None:
    found, recording = case("unbalance")
    wide = plan_follow_up(found, recording, Peaks(40.0, 2000.0, 330.0), RATE_HZ, 12.0)
    assert wide is not None
    assert not any("turn the base" in one.reason for one in wide.unparted)
    assert never_reason("quadratic_stiffness", "unbalance", 10.0)
    assert not never_reason("unbalance", "cubic_stiffness", 40.0)


def test_where_the_limits_leave_too_little_nothing_is_planned_and_the_verdict_says_so() -> None:
    found, recording = case("coulomb_friction")
    follow_up = plan_follow_up(found, recording, Peaks(0.04, 0.3, 5.0), RATE_HZ, 12.0)
    assert follow_up is not None and follow_up.plan is None
    assert f"{MIN_CHI_SQUARE:g} is needed" in follow_up.unparted[0].reason
    assert "No follow-up for" in with_follow_up(found, follow_up).verdict.sentences[-1]


def test_torque_that_no_drive_makes_well_is_no_way_out() -> None:
    found, recording = case("actuator_lag")
    follow_up = plan_follow_up(found, recording, Peaks(0.01, 0.9, 0.5), RATE_HZ, 12.0)
    assert follow_up is not None and follow_up.plan is None
    assert "at 0.30 N m or more" in follow_up.unparted[0].reason


def test_without_a_rival_nothing_is_planned() -> None:
    found, recording = case("actuator_lag")
    sure = replace(found, verdict=replace(found.verdict, confusable_with={"torque_delay": ()}))
    assert plan_follow_up(sure, recording, ALLOWED, RATE_HZ, 12.0) is None


def test_without_torque_nothing_is_planned_and_the_reason_is_said() -> None:
    found, recording = case("actuator_lag")
    free = replace(recording, runs=tuple(replace(r, torque_nm=None, torque_time_s=None) for r in recording.runs))
    follow_up = plan_follow_up(found, free, ALLOWED, RATE_HZ, 12.0)
    assert follow_up is not None and follow_up.plan is None
    assert "without a recorded torque" in follow_up.unparted[0].reason


def test_a_rival_that_the_finished_model_excludes_is_not_planned_for() -> None:
    """It was a rival before the delay was found; in its place beside the delay it leaves far too much."""
    found, recording = case("actuator_lag")
    assert found.final.platform is not None
    rough = replace(found.final.platform, effects={
        "cubic_stiffness": {"factor": 500.0}, "quadratic_damping": {"factor": 1e-3}
    })  # fmt: skip
    verdict = replace(
        found.verdict, confusable_with={"torque_delay": ("cubic_stiffness",)},
        rival_models={"torque_delay": {"cubic_stiffness": rough}},
    )  # fmt: skip
    follow_up = plan_follow_up(replace(found, verdict=verdict), recording, ALLOWED, RATE_HZ, 12.0)
    assert follow_up is not None and follow_up.plan is None
    assert "already exclude the alternative" in follow_up.unparted[0].reason


def test_the_file_is_an_excitation_that_a_rig_yaml_may_name(tmp_path: Path) -> None:
    plan = plan_for("cubic_stiffness")
    (tmp_path / "follow_up.yaml").write_text(follow_up_yaml(plan), encoding="utf-8")
    (tmp_path / "rig.yaml").write_text("backend: simulated\nsimulated: {}\nexcitation: follow_up.yaml\n")
    loaded = load_config(tmp_path / "rig.yaml")
    assert loaded.config.excitation == ExcitationConfig.model_validate(dict(plan.excitation))


@EACH_PAIR
def test_the_blind_bench_plays_the_same_torque_from_the_file(tmp_path: Path, rival: str) -> None:
    path = tmp_path / "follow_up.yaml"
    plan = plan_for(rival)
    path.write_text(follow_up_yaml(plan), encoding="utf-8")
    theirs, rate_hz = read(path)
    assert rate_hz == RATE_HZ
    for mine, other in zip(sets_of(plan), theirs, strict=True):
        times = np.arange(round(mine.duration_s * rate_hz)) / rate_hz
        assert mine.name == other.name
        assert other.torque(times) == pytest.approx(mine.torque(times), rel=2e-3, abs=1e-3)
