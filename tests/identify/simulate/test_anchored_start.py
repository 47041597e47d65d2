"""Behind lost readings a gyro's angle begins where the spring holds what torque and motion leave to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from identify.simulate.anchored_start import anchor
from identify.simulate.shots import make_shots
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Run
from tests.identify.simulated import NOISE_RAD_S

JCK = (3.3e-4, 8.4e-4, 6.15)
CUBIC = {"cubic_stiffness": {"factor": 30.0}}
BIAS_RAD_S = 0.03


def stepped(lost: tuple[tuple[int, int], ...] = (), seed: int = 1) -> Run:
    """Torque in steps, a gyro with a bias, and samples that are lost."""
    time = np.arange(10_001) * 2e-3
    rng = np.random.default_rng(seed)
    torque = np.repeat(rng.uniform(-0.14, 0.14, 126), 80)[: len(time)]
    signal = TorqueSignal(time, torque, "zero_order")
    rate = simulate(Platform(*JCK, CUBIC), time, signal, substeps=8).sensed_rate_rad_s
    valid = np.ones(len(time), bool)
    for a, b in lost:
        valid[a:b] = False
    rate = np.where(valid, rate + BIAS_RAD_S + NOISE_RAD_S * rng.standard_normal(len(time)), np.nan)
    return Run(
        "steps", time, valid, rate_rad_s=rate, torque_time_s=time, torque_nm=torque, torque_hold="zero_order",
    )  # fmt: skip


def trace_of(run: Run) -> Trace:
    return one_noise([prepare(run)], False)[0]


LOST = ((3123, 3165), (6523, 6565), (8203, 8245))


def test_lost_readings_do_not_throw_a_platform_whose_spring_stiffens() -> None:
    problem = PredictionError([trace_of(stepped(LOST))])
    start: dict[Name, float] = {(t,): v for t, v in zip(TERMS, JCK, strict=True)}
    found = problem.fit(Structure().plus("cubic_stiffness"), {**start, ("cubic_stiffness", "factor"): 30.0})
    assert found.reduced_chi_square < 1.2
    for term, true in zip(TERMS, JCK, strict=True):
        assert found.values[(term,)] == pytest.approx(true, rel=5e-3), term


def test_a_start_is_moved_to_the_balance_where_it_is_farther_off_than_the_platform_swings() -> None:
    run, equations = stepped(LOST), Equations(Platform(*JCK, CUBIC))
    trace = trace_of(run)
    shots = make_shots(trace, 4, None, None, equations)
    truth = simulate(
        Platform(*JCK, CUBIC), run.time_s, TorqueSignal(run.time_s, run.torque_nm, "zero_order"), substeps=8
    )
    right = truth.angle_rad[shots.first]
    shots.starts[:, 0] = right + 1.0
    anchor(shots, equations)
    assert not shots.anchored[0]
    assert shots.starts[0, 0] == right[0] + 1.0
    assert np.all(shots.anchored[1:])
    assert shots.starts[1:, 0] == pytest.approx(right[1:], abs=0.02)
    assert np.all(shots.since_s[1:] == 0.0)


def test_a_start_that_may_be_right_and_one_without_a_spring_stay() -> None:
    run, equations = stepped(LOST), Equations(Platform(*JCK, CUBIC))
    shots = make_shots(trace_of(run), 4, None, None, equations)
    begun = shots.starts.copy()
    anchor(shots, Equations(Platform(*JCK[:2], 0.0)))
    assert np.array_equal(shots.starts, begun)
    read = replace(run, angle_rad=np.zeros(len(run.time_s)))
    beside = make_shots(trace_of(read), 4, None, None, equations)
    begun = beside.starts.copy()
    anchor(beside, equations)
    assert np.array_equal(beside.starts, begun)
