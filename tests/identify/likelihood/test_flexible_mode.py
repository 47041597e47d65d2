"""A platform with a flexible mode and a torque that nobody recorded."""

from __future__ import annotations

import numpy as np

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Run

JCK = (4.0, 18.0, 470.0)
MODE = {"inertia": 1.3, "frequency": 2.4, "ratio": 0.07}
STEP_S, SECONDS = 0.02, 50.0
GYRO_NOISE = 3e-4
TORQUE_NM = 15.0


def _run(frequency_hz: float, seed: int) -> Run:
    """A sine with a white and a slow torque beside it, 2 % of it each, that is not in the record."""
    rng = np.random.default_rng(seed)
    time = STEP_S * np.arange(round(SECONDS / STEP_S))
    torque = TORQUE_NM * np.sin(2.0 * np.pi * frequency_hz * time)
    slow, decay = np.zeros(len(time)), np.exp(-STEP_S / 0.4)
    for i in range(1, len(time)):
        slow[i] = decay * slow[i - 1] + np.sqrt(1.0 - decay**2) * rng.standard_normal()
    hidden = 0.02 * TORQUE_NM * (slow + rng.standard_normal(len(time)))
    platform = Platform(*JCK, {"flexible_mode": MODE})
    motion = simulate(platform, time, TorqueSignal(time, torque + hidden, "zero_order"), start=(0.0, 0.0), substeps=16)
    rate = motion.sensed_rate_rad_s + GYRO_NOISE * rng.standard_normal(len(time))
    return Run(
        f"{frequency_hz} Hz", time, np.ones(len(time), bool), rate_rad_s=rate, torque_time_s=time, torque_nm=torque,
        torque_hold="zero_order",
    )  # fmt: skip


def test_inertia_beside_a_mode_is_right_from_a_start_far_off() -> None:
    runs = [_run(f, 10 + i) for i, f in enumerate((0.8, 1.9, 2.6))]
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    start = {("inertia",): 4.7, ("damping",): 16.0, ("stiffness",): 540.0}
    start |= {("flexible_mode", k): off * MODE[k] for k, off in (("inertia", 1.3), ("frequency", 0.96), ("ratio", 1.3))}
    fit = problem.fit(Structure(effects=("flexible_mode",)), start)
    truth = {(k,): v for k, v in zip(("inertia", "damping", "stiffness"), JCK, strict=True)}
    truth |= {("flexible_mode", k): v for k, v in MODE.items()}
    for name, value in truth.items():
        assert abs(fit.values[name] - value) < 4.0 * fit.std_error(name), name
    assert fit.std_error(("inertia",)) < 0.01 * JCK[0]
