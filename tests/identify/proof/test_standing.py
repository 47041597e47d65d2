"""How a run finds the platform: what a loop remembers of the run before, and how long a mode rings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identify.proof.deviation import deviation, simulated_run
from identify.proof.drive import Drive
from identify.proof.plan import ALL, PLAIN, plan_proof
from identify.proof.standing import RING_LEFT, Standing, rest_needed_s
from identify.proof.wording import plan_lines
from rig.excitation import PlannedSet, Sine
from rig.platform import Platform
from rig.preflight import Peaks

LINEAR = Platform(0.0203, 0.0447, 681.2)
LOOP = replace(
    LINEAR, effects={"hysteresis": {"level": 2.0, "yield_angle": 0.02, "exponent": 1.5, "share": 0.5}}
)  # fmt: skip
MODE = replace(LINEAR, effects={"flexible_mode": {"inertia": 0.02, "frequency": 68.0, "ratio": 0.02}})
SLOW = PlannedSet("0.5 Hz", Sine(torque_nm=60.0, frequency_hz=0.5, duration_s=4.0))
DRIVE = Drive(1e-3, "zero_order")
ALLOWED = Peaks(10.0, 400.0, 150.0)
NOISE_RAD_S = math.radians(0.05)


def test_a_loop_remembers_the_run_before_and_not_what_was_before_that() -> None:
    clean = Standing.untouched(LOOP)
    bent = Standing(clean.angle_rad, np.array([0.9]))
    one, other = (standing.after(SLOW, LOOP, DRIVE, 8.0) for standing in (clean, bent))
    assert one.states[0] == pytest.approx(0.175, abs=0.05)
    np.testing.assert_allclose(one.states, other.states, atol=3e-3)  # of two cycles
    assert LOOP.stiffness_nm_rad * one.angle_rad == pytest.approx(-2.0 * one.states[0], rel=1e-6)


def test_a_compensation_begins_with_what_the_loop_remembers() -> None:
    plan = plan_proof(LOOP, [SLOW], ALLOWED, DRIVE, rest_s=8.0)
    found = Standing.untouched(LOOP).after(plan.of("0.5 Hz", PLAIN), LOOP, DRIVE, 8.0)
    wanted = plan.of("0.5 Hz", ALL)
    left = deviation(simulated_run(wanted, LOOP, DRIVE, False, begin=found), wanted, LOOP, 1e-9)
    assert left.rms < 0.1 * NOISE_RAD_S  # 7.6 times the noise where it begins as if nothing had moved the loop
    forgot = plan_proof(LOOP, [SLOW], ALLOWED, DRIVE).of("0.5 Hz", ALL)
    assert float(np.max(np.abs(forgot.torque(np.arange(4000) * 1e-3) - wanted.torque(np.arange(4000) * 1e-3)))) > 0.2


def test_a_rest_lasts_until_the_ring_of_a_mode_is_lost_in_the_noise() -> None:
    needed_s = rest_needed_s([SLOW], MODE, DRIVE, False, NOISE_RAD_S, 2.0)
    decay = 0.5 * MODE.damping_nm_s_rad / (MODE.inertia_kg_m2 + 0.02)  # of both inertias as one
    quieter_s = rest_needed_s([SLOW], MODE, DRIVE, False, NOISE_RAD_S / math.e, 2.0)
    assert 5.0 < needed_s < 30.0 and quieter_s - needed_s == pytest.approx(1.0 / decay, rel=0.1)
    assert rest_needed_s([SLOW], MODE, DRIVE, False, NOISE_RAD_S, 60.0) == 60.0
    assert 0.0 < RING_LEFT < 1.0


def test_the_ring_of_the_linear_model_alone_is_not_waited_for() -> None:
    cubic = replace(LINEAR, effects={"cubic_stiffness": {"factor": 1000.0}})
    assert rest_needed_s([SLOW], cubic, DRIVE, False, NOISE_RAD_S, 2.0) == 2.0


def test_longer_rests_are_said_before_anything_moves() -> None:
    plan = plan_proof(MODE, [SLOW], ALLOWED, DRIVE, rest_s=2.0, noise=NOISE_RAD_S)
    assert any(f"last {plan.rest_s:.1f} s in place of 2 s" in line for line in plan_lines(plan, MODE, 2.0))
