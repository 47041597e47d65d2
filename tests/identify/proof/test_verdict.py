"""The verdict of a proof: right names confirmed, wrong ones refuted, and nothing claimed that the runs do not show."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.proof.deviation import Deviation, share_left
from identify.proof.drive import Drive
from identify.proof.plan import ALL, PLAIN, RESERVE, ProofPlan, plan_proof
from identify.proof.seen import expected_peaks
from identify.proof.verdict import _material, judge, status_of
from identify.proof.wording import lines, plan_lines
from identify.proven import EffectProof, Proof, ProofSet, ProofStatus, Share
from identify.report.proof import proof_json
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.excitation import PlannedSet, Sine
from rig.platform import Platform
from rig.preflight import Peaks, peaks
from rig.recording.run import Recording, Run
from tests.identify.proof.test_compensation import LINEAR, with_effects

NOISE_RAD_S = 8.7e-4
ALLOWED = Peaks(10.0, 400.0, 150.0)
DRIVE = Drive(1e-3, "zero_order")
SETS = (
    PlannedSet("1 Hz", Sine(torque_nm=60.0, frequency_hz=1.0, duration_s=3.0)),
    PlannedSet("6 Hz", Sine(torque_nm=50.0, frequency_hz=6.0, duration_s=3.0)),
)
COULOMB = with_effects(coulomb_friction={"level": 1.0})
CUBIC = with_effects(cubic_stiffness={"factor": 1000.0})
BOTH = with_effects(coulomb_friction={"level": 1.0}, cubic_stiffness={"factor": 1000.0})


def played(truth: Platform, planned: PlannedSet, seed: int) -> Run:
    """What a gyro would measure of a planned set on ``truth``, its commands held."""
    time_s = np.arange(0.0, planned.duration_s, 1e-3)
    torque = np.asarray(planned.torque(time_s), dtype=float)
    start = (Equations(truth).rest_angle_rad(), 0.0)
    motion = simulate(truth, time_s, TorqueSignal(time_s, torque, "zero_order"), start)
    rate = motion.sensed_rate_rad_s + np.random.default_rng(seed).normal(0.0, NOISE_RAD_S, len(time_s))
    return Run(
        planned.name, time_s, np.ones(len(time_s), dtype=bool), rate_rad_s=rate, torque_time_s=time_s, torque_nm=torque,
        torque_hold="zero_order",
    )  # fmt: skip


def recorded(truth: Platform, plan: ProofPlan) -> Recording:
    runs = tuple(played(truth, run.planned, i) for i, run in enumerate(plan.runs))
    return Recording(runs, noise=NOISE_RAD_S)


def proof_of(truth: Platform, model: Platform, rivals: Mapping[str, Platform] | None = None) -> Proof:
    plan = plan_proof(model, SETS, ALLOWED, DRIVE, rivals=rivals)
    return judge(plan, recorded(truth, plan), model)


@cache
def of_both() -> Proof:
    return proof_of(BOTH, BOTH)


def test_a_right_name_is_confirmed_with_its_share_and_interval() -> None:
    proof = proof_of(CUBIC, CUBIC)
    assert proof.total.status == "confirmed" and proof.effects["cubic_stiffness"].status == "confirmed"
    share = proof.total.share
    assert share is not None and share.left < 0.01 and share.ci95[0] <= share.left <= share.ci95[1]
    assert [s.set for s in proof.total.sets] == ["1 Hz", "6 Hz"]
    for one in proof.total.sets:
        assert one.error_without > 20.0 * NOISE_RAD_S and one.error_compensated < 1.2 * NOISE_RAD_S


def test_a_wrong_name_is_refuted() -> None:
    wrong = with_effects(quadratic_damping={"factor": 0.01})
    proof = proof_of(CUBIC, wrong)
    assert proof.effects["quadratic_damping"].status == "refuted"
    assert "If this effect were the cause, it would have been cancelled" in proof.total.why


def test_of_several_each_is_judged_by_what_comes_back_without_it() -> None:
    proof = of_both()
    assert {name: one.status for name, one in proof.effects.items()} == {
        "coulomb_friction": "confirmed", "cubic_stiffness": "confirmed"
    }  # fmt: skip
    assert proof.effects["cubic_stiffness"].sets[0].without == "proof: 1 Hz, all but cubic_stiffness"


def test_a_name_too_small_to_be_seen_is_not_played_without_and_takes_nothing_from_the_others() -> None:
    late = with_effects(coulomb_friction={"level": 1.0}, torque_delay={"delay": 2e-6})
    plan = plan_proof(late, SETS, ALLOWED, DRIVE)
    assert {run.variant for run in plan.runs} == {PLAIN, ALL, "coulomb_friction"}
    assert list(plan.too_small) == ["torque_delay"]
    assert any("Torque delay: too small to be seen" in line for line in plan_lines(plan, late))
    proof = judge(plan, recorded(late, plan), late)
    assert {name: one.status for name, one in proof.effects.items()} == {
        "coulomb_friction": "confirmed", "torque_delay": "cannot be told"
    }  # fmt: skip
    assert "to test it alone" in " ".join(lines(proof)) and proof_json(proof)["effects"]["torque_delay"]["gone"] is None


def test_an_error_that_grew_is_said_so() -> None:
    assert status_of(Share(3.5, (3.0, 4.0)), 0.05, 50.0**2)[1].startswith(
        "the error grew to 3.5 times what it was; 95 %"
    )


def test_a_name_that_leaves_another_effect_is_not_all_of_it() -> None:
    total = proof_of(with_effects(coulomb_friction={"level": 0.03}, **CUBIC.effects), CUBIC).total
    assert total.status == "partly" and "The rest has another cause" in total.why


def test_a_right_name_beside_a_wrong_damping_is_not_refuted() -> None:
    one = proof_of(CUBIC, replace(CUBIC, damping_nm_s_rad=-0.02)).effects["cubic_stiffness"]
    assert one.share is not None and one.share.ci95[0] > 0.7
    assert one.status == "partly" and "J, C and K, are inaccurate. Identify again from all runs" in one.why


def test_an_effect_that_makes_nothing_explains_nothing() -> None:
    tiny = with_effects(quadratic_damping={"factor": 1e-9})
    total = proof_of(CUBIC, tiny).total
    assert total.status == "refuted"


def test_a_saturation_stays_and_that_is_no_refutation() -> None:
    clipped = with_effects(torque_saturation={"limit": 45.0})
    total = proof_of(clipped, clipped).total
    assert total.status == "cannot be told" and total.announced_left > 0.9


def test_where_there_is_no_error_nothing_can_be_told() -> None:
    total = proof_of(LINEAR, with_effects(cubic_stiffness={"factor": 1e-3})).total
    assert total.status == "cannot be told" and total.share is None


def test_a_rival_that_leaves_more_is_refuted() -> None:
    proof = proof_of(
        COULOMB, COULOMB, {"coulomb_friction / quadratic_damping": with_effects(quadratic_damping={"factor": 0.02})}
    )
    assert proof.effects["coulomb_friction"].status == "confirmed"
    assert proof.rivals["coulomb_friction / quadratic_damping"].status == "refuted"


def test_a_name_that_leaves_more_than_its_rival_is_refuted() -> None:
    wrong = with_effects(quadratic_damping={"factor": 0.02})
    proof = proof_of(COULOMB, wrong, {"quadratic_damping / coulomb_friction": COULOMB})
    assert proof.effects["quadratic_damping"].status == "refuted"
    assert proof.rivals["quadratic_damping / coulomb_friction"].status == "confirmed"


@pytest.mark.parametrize(
    ("model", "alone", "speaks"), [(COULOMB, "partly", True), (COULOMB, "confirmed", False), (CUBIC, "confirmed", True)]
)
def test_what_a_name_said_chance_may_leave_does_not_speak_against_it(
    model: Platform, alone: ProofStatus, speaks: bool
) -> None:
    """Stribeck friction announced 15 to 24 % for where it may rest; Coulomb friction in its place had left less."""
    share = Share(0.08, (0.07, 0.09))
    row = ProofSet("1 Hz", "plain", "better", 1.0, 0.08, 0.001, share, 0.15, 1.0)
    worse = EffectProof(alone, "", share, 0.15, (row,))
    assert _material(0.75, worse, model) == speaks
    assert not _material(0.95, worse, model)
    assert not _material(1.3, replace(worse, sets=(replace(row, noise=0.08),)), model)


def test_a_rival_that_is_the_same_along_the_motion_cannot_be_told() -> None:
    gravity = with_effects(unbalance={"sine": -60.0, "cosine": 0.0})
    cubic = replace(with_effects(cubic_stiffness={"factor": 10.0}), stiffness_nm_rad=LINEAR.stiffness_nm_rad - 60.0)
    proof = proof_of(gravity, gravity, {"unbalance / cubic_stiffness": cubic})
    assert proof.rivals["unbalance / cubic_stiffness"].status == "cannot be told"
    assert proof.effects["unbalance"].status == "cannot be told"


def test_sets_that_are_not_complete_are_left_out_and_none_is_no_proof() -> None:
    plan = plan_proof(CUBIC, SETS, ALLOWED, DRIVE)
    whole = recorded(CUBIC, plan)
    half = replace(whole, runs=whole.runs[:2])
    assert [s.set for s in judge(plan, half, CUBIC).total.sets] == ["1 Hz"]
    with pytest.raises(ValueError, match="no set of the proof was played both with and without"):
        judge(plan, replace(whole, runs=whole.runs[:1]), CUBIC)


def test_of_a_variant_that_was_stopped_before_its_first_set_nothing_is_told() -> None:
    """A rival whose runs were cut short had left "1 times" the error of the name."""
    gravity = with_effects(unbalance={"sine": -60.0, "cosine": 0.0})
    plan = plan_proof(CUBIC, SETS, ALLOWED, DRIVE, rivals={"cubic_stiffness / unbalance": gravity})
    whole = recorded(CUBIC, plan)
    rival = {one.planned.name for one in plan.runs if " / " in one.variant}
    proof = judge(plan, replace(whole, runs=tuple(r for r in whole.runs if r.name not in rival)), CUBIC)
    (told,) = proof.rivals.values()
    assert told.status == "cannot be told" and "stopped before" in told.why and not told.sets
    assert proof.effects["cubic_stiffness"].status == "confirmed"


def test_the_share_takes_the_noise_off_and_its_interval_holds_the_truth() -> None:
    rng, held = np.random.default_rng(3), 0
    time_s = np.arange(0.0, 3.0, 1e-3)
    keep = np.ones(len(time_s), dtype=bool)
    for _ in range(40):
        shape = np.sin(2.0 * np.pi * 3.0 * time_s) * 5e-3
        several = [
            Deviation(time_s, factor * shape + rng.normal(0.0, NOISE_RAD_S, len(time_s)), keep, NOISE_RAD_S)
            for factor in (1.0, 0.3)
        ]
        share = share_left([(several[0], several[1], 3.0)])
        assert share is not None
        held += share.ci95[0] <= 0.3 <= share.ci95[1]
    assert held >= 34


@pytest.mark.parametrize(
    ("left", "low", "announced", "status"),
    [
        (0.05, 0.04, 0.01, "confirmed"), (0.25, 0.2, 0.2, "confirmed"), (0.25, 0.2, 0.05, "partly"),
        (0.9, 0.65, 0.05, "partly"), (0.99, 0.5, 0.68, "partly"), (0.83, 0.5, 0.68, "confirmed"),
        (0.9, 0.8, 0.05, "refuted"), (1.0, 0.99, 0.95, "cannot be told"),
    ],
)  # fmt: skip
def test_the_limits_of_the_verdict(left: float, low: float, announced: float, status: str) -> None:
    assert status_of(Share(left, (low, 1.2)), announced, 50.0**2)[0] == status


def test_a_name_that_makes_little_of_a_large_error_explains_nothing() -> None:
    status, why = status_of(Share(1.0, (0.99, 1.01)), 0.95, 50.0**2, over_announced=9.0)
    assert status == "refuted" and "9 times the error that this effect predicts" in why


def test_what_is_noise_is_confirmed_whatever_share_of_little_it_is() -> None:
    assert status_of(Share(0.4, (0.3, 0.5)), 0.0, 1.1**2)[0] == "confirmed"


def test_result_json_and_the_sentences_hold_what_was_found() -> None:
    proof = of_both()
    content = json.loads(json.dumps(proof_json(proof)))
    assert content["status"] == "confirmed" and set(content["effects"]) == {"coulomb_friction", "cubic_stiffness"}
    low, high = content["total"]["gone_ci95"]
    assert low <= content["total"]["gone"] <= high
    assert content["total"]["per_set"][0]["compensated"] == "proof: 1 Hz, compensated"
    said = lines(proof)
    assert said[0].startswith("All together: confirmed.") and any(s.startswith("Cubic stiffness: ") for s in said)


def test_what_will_stay_is_said_before_anything_moves() -> None:
    model = replace(COULOMB, effects={**COULOMB.effects, "torque_saturation": {"limit": 90.0}})
    said = "\n".join(plan_lines(plan_proof(model, SETS, ALLOWED, DRIVE), model))
    assert "of the error against the linear model will remain" in said
    assert "Coulomb friction: friction holds the platform anywhere within a band" in said
    assert "Torque saturation is not compensated: above its limit the drive gives no more torque" in said


def test_the_recorded_run_tells_what_a_wrong_compensation_would_do() -> None:
    wrong = with_effects(cogging={"sine": 3.0, "cosine": 0.0, "order": 60.0})
    run = replace(played(LINEAR, SETS[1], 1), name="6 Hz")
    plan = plan_proof(wrong, SETS[1:], ALLOWED, DRIVE)
    plain, better = plan.of("6 Hz", PLAIN), plan.of("6 Hz", ALL)
    before, after = (expected_peaks(run, plain, s, wrong) for s in (plain, better))
    assert before is not None and after is not None and after.rate_deg_s > 1.1 * before.rate_deg_s
    true = peaks(LINEAR, better)
    assert after.rate_deg_s == pytest.approx(true.rate_deg_s, rel=0.02)
    tight = ALLOWED._replace(rate_deg_s=0.97 * after.rate_deg_s / RESERVE)
    assert "6 Hz" in plan_proof(wrong, SETS[1:], tight, DRIVE, recorded=[run]).torque_scale


def test_of_dry_friction_a_recorded_run_tells_nothing_beforehand() -> None:
    run = replace(played(COULOMB, SETS[1], 1), name="6 Hz")
    plan = plan_proof(COULOMB, SETS[1:], ALLOWED, DRIVE, recorded=[run])
    assert expected_peaks(run, plan.of("6 Hz", PLAIN), plan.of("6 Hz", ALL), COULOMB) is None
    assert not plan.torque_scale
