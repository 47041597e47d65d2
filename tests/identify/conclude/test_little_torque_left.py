"""Where the sensor's noise limits the runs, a little torque that is left is judged as a torque, not by the sensor."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.pipeline import identify
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, NOISE_RAD_S, SETS, TRUTH


def disturbed(torque_nm: float, frequency_hz: float, disturbance_nm: float, seed: int) -> Run:
    """A sine set with a slow random torque beside the recorded one."""
    time = np.arange(4001) * 1e-3
    rng = np.random.default_rng(seed)
    known = torque_nm * np.sin(2 * np.pi * frequency_hz * time)
    slow = lfilter([0.02], [1.0, -0.98], rng.standard_normal(len(time)))
    real = TorqueSignal(time, known + disturbance_nm * slow / np.std(slow))
    rate = simulate(Platform(*TRUTH), time, real, start=(0.0, 0.0), substeps=16).sensed_rate_rad_s
    return Run(
        f"{frequency_hz:g} Hz", time, np.ones(len(time), bool), torque_time_s=time, torque_nm=known,
        rate_rad_s=rate + NOISE_RAD_S * rng.standard_normal(len(time)), frequency_hz=frequency_hz,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("disturbance_nm", [0.0005, 0.0007])
def test_a_hundred_thousandth_of_the_torque_is_accepted_though_a_free_run_shows_it(disturbance_nm: float) -> None:
    runs = tuple(disturbed(m, f, disturbance_nm, i) for i, (m, f) in enumerate(SETS))
    found = identify(Recording(runs), DECLARED, IdentifyConfig())
    assert found.final.error.holdout_rate_rms is not None and found.noise_floor.holdout_rate_rms is not None
    assert found.final.error.holdout_rate_rms > 1.1 * found.noise_floor.holdout_rate_rms
    assert found.accepted, found.reasons
    assert found.verdict.effects == ()
    for value, true in zip(found.final.parameters.values(), TRUTH, strict=True):
        assert value.value == pytest.approx(true, abs=4.0 * value.std_error)


def beside_a_mode(torque_nm: float, low_hz: float, high_hz: float, seed: int) -> Run:
    """A chirp or a sine beside a small second mass, with a torque noise of 0.3 % that is not recorded."""
    time = np.arange(5001) * 1e-3
    rng = np.random.default_rng(seed)
    known = torque_nm * np.sin(2 * np.pi * (low_hz * time + (high_hz - low_hz) / 10.0 * time**2))
    noise = lfilter([0.3], [1.0, -0.7], rng.standard_normal(len(time)))
    real = TorqueSignal(time, known + 0.003 * 0.7 * torque_nm * noise / np.std(noise))
    platform = Platform(0.01, 0.02, 5.0, {"flexible_mode": {"inertia": 2e-4, "frequency": 30.0, "ratio": 0.015}})
    rate = simulate(platform, time, real, start=(0.0, 0.0), substeps=16).sensed_rate_rad_s
    return Run(
        f"{low_hz:g} Hz", time, np.ones(len(time), bool), torque_time_s=time, torque_nm=known,
        rate_rad_s=rate + 3e-3 * rng.standard_normal(len(time)),
    )  # fmt: skip


@pytest.mark.slow
def test_what_depends_on_nothing_and_is_a_thousandth_of_the_torque_refuses_no_model_that_is_right() -> None:
    sets = ((0.3, 1.0, 50.0), (0.3, 2.0, 2.0), (0.4, 5.0, 5.0), (0.6, 12.0, 12.0))
    runs = tuple(beside_a_mode(*given, seed=i) for i, given in enumerate(sets))
    declared = Platform(0.009, 0.03, 5.5)
    found = identify(Recording(runs), declared, IdentifyConfig(candidates=("flexible_mode", "coulomb_friction")))
    assert found.verdict.effects == ("flexible_mode",)
    assert found.final.parameters["inertia"].value == pytest.approx(0.01, rel=2e-3)
    assert found.accepted, found.reasons
    assert found.disturbance is not None
    assert found.disturbance.relative < 0.005  # runs of five seconds have ends, too, where the low-pass has not settled
