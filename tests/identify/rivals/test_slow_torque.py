"""A slow torque that no reading shows by itself: three effects, one of them flexible, are still named."""

from __future__ import annotations

import numpy as np
import pytest

from identify.pipeline import identify
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run

HIDDEN = {
    "coulomb_friction": {"level": 50.0},
    "flexible_mode": {"inertia": 5.0, "frequency": 1.55, "ratio": 0.09},
    "actuator_lag": {"time": 0.004},
}
TRUTH = Platform(90.0, 440.0, 0.0, HIDDEN)
DECLARED = Platform(95.0, 800.0, 0.0, {}, terms=("inertia", "damping"))
STEP_S = 0.01
SLOW_S = 2.0
SLOW_SHARE = 0.01  # of the torque, root mean square
NOISE_RAD_S = 0.004


def run(seed: int) -> Run:
    """A multisine below the mode, read by a gyro whose noise hides the slow torque from one sample to the next."""
    rng = np.random.default_rng(seed)
    time = STEP_S * np.arange(4001)
    tones = np.linspace(0.12, 1.4, 14)
    torque = 100.0 * np.sum(np.sin(2.0 * np.pi * np.outer(time, tones) + rng.uniform(0.0, 2.0 * np.pi, 14)), axis=1)
    stays = np.exp(-STEP_S / SLOW_S)
    kicks = SLOW_SHARE * np.sqrt(np.mean(torque**2) * (1.0 - stays**2)) * rng.standard_normal(len(time))
    slow = np.zeros(len(time))
    for i in range(1, len(time)):
        slow[i] = stays * slow[i - 1] + kicks[i]
    rate = simulate(TRUTH, time, TorqueSignal(time, torque + slow), start=(0.0, 0.0), substeps=16).sensed_rate_rad_s
    noise = NOISE_RAD_S * rng.standard_normal(len(time))
    return Run(
        f"run {seed}", time, np.ones(len(time), bool), rate_rad_s=rate + noise, torque_time_s=time, torque_nm=torque
    )  # fmt: skip


@pytest.mark.slow
def test_what_a_free_run_leaves_beyond_white_noise_is_looked_at_as_a_torque() -> None:
    found = identify(Recording((run(1), run(2))), DECLARED, IdentifyConfig(candidates=tuple(HIDDEN)))
    assert set(found.verdict.effects) == set(HIDDEN)
    assert found.accepted, found.reasons
    assert found.disturbance is not None
    assert 0.5 * SLOW_SHARE < found.disturbance.relative < 2.0 * SLOW_SHARE
    assert found.final.parameters["inertia"].value == pytest.approx(90.0, rel=0.01)
    assert found.final.parameters["damping"].value == pytest.approx(440.0, rel=0.01)
