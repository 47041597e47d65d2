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


@pytest.mark.parametrize("disturbance_nm", [0.0005, pytest.param(0.0007, marks=pytest.mark.slow)])
def test_a_hundred_thousandth_of_the_torque_is_accepted_though_a_free_run_shows_it(disturbance_nm: float) -> None:
    runs = tuple(disturbed(m, f, disturbance_nm, i) for i, (m, f) in enumerate(SETS))
    found = identify(Recording(runs), DECLARED, IdentifyConfig())
    assert found.final.error.holdout_rate_rms is not None and found.noise_floor.holdout_rate_rms is not None
    assert found.final.error.holdout_rate_rms > 1.1 * found.noise_floor.holdout_rate_rms
    assert found.accepted, found.reasons
    assert found.verdict.effects == ()
    for value, true in zip(found.final.parameters.values(), TRUTH, strict=True):
        assert value.value == pytest.approx(true, abs=4.0 * value.std_error)
