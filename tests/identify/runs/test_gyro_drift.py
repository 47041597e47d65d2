"""How far a gyro's angle has drifted is told by the spring that holds the platform."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.torque_residual import torque_residual
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.gyro_drift import without_drift
from identify.signals.low_pass import settled
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import UPSAMPLING, Trace
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Run
from tests.identify.simulated import NOISE_RAD_S

JCK = (3.3e-4, 8.4e-4, 6.15)
CUBIC = {"cubic_stiffness": {"factor": 30.0}}
BIAS_RAD_S = 0.03
LOST = ((3123, 3165), (6523, 6565), (8203, 8245))
SHORT = ((3123, 3147), (6523, 6547), (6700, 6724), (8203, 8227))  # what is filled in: most of a swing of 22 Hz
CUTOFF_HZ = 40.0


def stepped(lost: tuple[tuple[int, int], ...] = (), walk: float = 0.0, stiffness: float = JCK[2]) -> tuple[Run, Array]:
    """Torque in steps, a gyro whose bias walks, and samples that are lost; and the true angle, (n,)."""
    time = np.arange(10_001) * 2e-3
    rng = np.random.default_rng(1)
    torque = np.repeat(rng.uniform(-0.14, 0.14, 126), 80)[: len(time)]
    signal = TorqueSignal(time, torque, "zero_order")
    effects = CUBIC if stiffness else {}
    motion = simulate(Platform(JCK[0], JCK[1], stiffness, effects), time, signal, substeps=8)
    valid = np.ones(len(time), bool)
    for a, b in lost:
        valid[a:b] = False
    bias = BIAS_RAD_S + walk * np.sqrt(2e-3) * np.cumsum(rng.standard_normal(len(time)))
    rate = motion.sensed_rate_rad_s + bias + NOISE_RAD_S * rng.standard_normal(len(time))
    run = Run(
        "steps", time, valid, rate_rad_s=np.where(valid, rate, np.nan), torque_time_s=time, torque_nm=torque,
        torque_hold="zero_order",
    )  # fmt: skip
    return run, motion.angle_rad


def trace_of(run: Run) -> Trace:
    return one_noise([prepare(run)], False)[0]


@pytest.mark.parametrize(("lost", "walk"), [((), 0.0), ((), 3e-3), (LOST, 0.0), (LOST, 3e-3), (SHORT, 0.0)])
def test_the_angle_stays_with_the_platform(lost: tuple[tuple[int, int], ...], walk: float) -> None:
    run, true = stepped(lost, walk)
    trace = trace_of(run)
    (held,) = without_drift([trace], CUTOFF_HZ)
    off = [np.max(np.abs((t.fine[0][::UPSAMPLING] - true)[t.keep])) for t in (trace, held)]
    assert off[0] > 0.4
    assert off[1] < 0.01  # of a swing of 0.05 rad


def test_lost_readings_do_not_throw_a_platform_whose_spring_stiffens() -> None:
    run, _ = stepped(LOST)
    problem = PredictionError(without_drift([trace_of(run)], CUTOFF_HZ))
    start: dict[Name, float] = {(t,): v for t, v in zip(TERMS, JCK, strict=True)}
    found = problem.fit(Structure().plus("cubic_stiffness"), {**start, ("cubic_stiffness", "factor"): 30.0})
    assert found.reduced_chi_square < 1.2
    for term, true in zip(TERMS, JCK, strict=True):
        assert found.values[(term,)] == pytest.approx(true, rel=5e-3), term


def test_the_true_model_leaves_no_torque_where_the_gyro_drifted() -> None:
    run, _ = stepped(LOST, 3e-3)
    structure = Structure().plus("cubic_stiffness")
    values: dict[Name, float] = {(t,): v for t, v in zip(TERMS, JCK, strict=True)}
    values[("cubic_stiffness", "factor")] = 30.0
    left = []
    for trace in (trace_of(run), *without_drift([trace_of(run)], CUTOFF_HZ)):
        found = torque_residual(trace, structure, values, CUTOFF_HZ)
        assert found is not None
        use = settled(trace.keep, trace.step_s, CUTOFF_HZ)
        left.append(float(np.std(found.residual[use]) / np.std(found.torque[use])))
    assert left[0] > 0.5
    assert left[1] < 0.02


def test_where_no_spring_holds_or_an_encoder_reads_the_angle_nothing_changes() -> None:
    free, _ = stepped(stiffness=0.0)
    run, angle = stepped()
    for kept in (
        trace_of(free),
        trace_of(replace(run, angle_rad=angle)),
        trace_of(replace(run, torque_nm=None, torque_time_s=None)),
    ):
        assert without_drift([kept], CUTOFF_HZ)[0].drift_rad is None
