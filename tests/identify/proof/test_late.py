"""Late ticks of a proof: counted by the recorded torque, and told apart from a wrong model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.proof.drive import Drive
from identify.proof.late import late_ticks
from identify.proof.plan import ALL, ProofPlan, plan_proof
from identify.proof.verdict import judge
from identify.proof.wording import lines
from identify.report.proof import proof_json
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import PlannedSet, Sine
from rig.platform import Platform
from rig.preflight import Peaks
from rig.recording.run import Recording, Run
from tests.identify.proof.test_compensation import with_effects
from tests.identify.proof.test_verdict import NOISE_RAD_S, played

SET = PlannedSet("6 Hz", Sine(torque_nm=50.0, frequency_hz=6.0, duration_s=3.0))
CUBIC = with_effects(cubic_stiffness={"factor": 3000.0})
STALLS_AT, STALL_TICKS = (400, 1000, 1900, 2400), 9


def late_run(truth: Platform, planned: PlannedSet) -> Run:
    """Of a loop that stalls: for some ticks the torque of the last one stands, and the gyro goes on."""
    time_s = np.arange(0.0, planned.duration_s, 1e-3)
    there = np.ones(len(time_s), dtype=bool)
    for first in STALLS_AT:
        there[first : first + STALL_TICKS] = False
    at_s = time_s[there]
    torque_nm = np.asarray(planned.torque(at_s), dtype=float)
    motion = simulate(truth, time_s, TorqueSignal(at_s, torque_nm, "zero_order"))
    rate = motion.rate_rad_s + np.random.default_rng(1).normal(0.0, NOISE_RAD_S, len(time_s))
    run = played(truth, planned, 1)
    return replace(run, rate_rad_s=rate, torque_time_s=at_s, torque_nm=torque_nm)


def recorded(truth: Platform, plan: ProofPlan, late: bool) -> Recording:
    runs = [
        late_run(truth, one.planned) if late and one.variant == ALL else played(truth, one.planned, i)
        for i, one in enumerate(plan.runs)
    ]
    return Recording(tuple(runs), noise=NOISE_RAD_S)


def plan_of(model: Platform) -> ProofPlan:
    return plan_proof(model, [SET], Peaks(10.0, 400.0, 150.0), Drive(1e-3, "zero_order"))


def test_late_ticks_are_counted_and_what_they_did_is_said() -> None:
    plan = plan_of(CUBIC)
    proof = judge(plan, recorded(CUBIC, plan, late=True), CUBIC)
    assert proof.late is not None and proof.late.late == len(STALLS_AT) * STALL_TICKS
    assert proof.late.reproduced == pytest.approx(1.0, abs=0.1)
    said = next(line for line in lines(proof) if "was late in" in line)
    assert "late in 36 of the 2999 ticks of the compensated runs" in said and "may be due to late ticks" in said
    assert proof_json(proof)["late_ticks"]["late"] == 36
    assert proof.total.status == "partly" and "Late ticks may account for the rest" in proof.total.why
    assert proof.effects["cubic_stiffness"].status == "partly"


def test_a_wrong_model_is_not_excused_by_late_ticks() -> None:
    plan = plan_of(with_effects(cubic_stiffness={"factor": 1000.0}))
    proof = judge(plan, recorded(CUBIC, plan, late=True), plan.models[ALL])
    assert proof.late is not None and proof.late.reproduced is not None and proof.late.reproduced < 0.3
    assert "Late ticks" not in proof.total.why


def test_of_ticks_in_time_nothing_is_said() -> None:
    plan = plan_of(CUBIC)
    proof = judge(plan, recorded(CUBIC, plan, late=False), CUBIC)
    assert proof.late is None and not any("was late in" in line for line in lines(proof))


def test_a_run_without_torque_has_no_ticks() -> None:
    run = Run("a", np.arange(3.0), np.ones(3, dtype=bool), rate_rad_s=np.zeros(3))
    assert late_ticks(run) == (0, 0)
