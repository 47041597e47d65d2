"""A held torque seen through a gyro's low-pass: the prediction agrees with the filtered truth, ripple and all."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.prepare import prepare
from identify.simulate.shots import make_shots, predict
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.dynamics.low_pass import low_pass_kernel, smoothed
from rig.platform import Platform
from rig.recording.run import Run

CORNER_HZ, DELAY_S, FINE = 262.0, 2.2e-3, 32
PLATFORM = Platform(inertia_kg_m2=0.0203, damping_nm_s_rad=0.0447, stiffness_nm_rad=681.2)


@pytest.mark.parametrize("late_s", [3e-5, 1.1e-4, 2.1e-4, 3.3e-4])
def test_a_prediction_behind_the_low_pass_is_neither_too_large_nor_too_small(late_s: float) -> None:
    time = 5e-4 * np.arange(4001)
    changes = np.concatenate([[0.0], late_s + 1e-3 * np.arange(1, 2000)])
    torque = TorqueSignal(changes, 50.0 * np.sin(2 * np.pi * 6 * changes), "zero_order")
    fine = np.linspace(0.0, time[-1], FINE * (len(time) - 1) + 1)
    truth = simulate(PLATFORM, fine, torque, substeps=1)
    seen = smoothed(truth.rate_rad_s, low_pass_kernel(CORNER_HZ, DELAY_S, fine[1]))[::FINE]
    run = Run(
        name="6 Hz", time_s=time, valid=np.ones(len(time), dtype=bool), rate_rad_s=seen,
        torque_time_s=changes, torque_nm=torque.torque_nm,
        torque_hold="zero_order", rate_corner_hz=CORNER_HZ, rate_delay_s=DELAY_S,
    )  # fmt: skip
    shots = make_shots(prepare(run), 2, None)
    starts = np.stack([truth.angle_rad, truth.rate_rad_s], axis=1)[::FINE][shots.first]
    expected = predict(shots, Equations(PLATFORM), starts, 0.0)
    w = shots.weight
    assert expected[w] @ seen[w] / (seen[w] @ seen[w]) == pytest.approx(1.0, abs=1.2e-5)
    assert np.std((expected - seen)[w]) < 1e-4 * np.std(seen)
