"""Moments in which the shaft saw another torque than the one recorded: they must not take the parameters along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, NOISE_RAD_S, SETS, TRUTH, sine_run

FEW = ["coulomb_friction", "stribeck_friction", "torque_delay", "creep"]


def disturbed(torque_nm: float, frequency_hz: float, late_s: float, seed: int) -> Run:
    """A set in which the torque stood still once for some milliseconds, as behind a host that stalls."""
    run = sine_run(torque_nm, frequency_hz)
    assert run.torque_nm is not None
    rng = np.random.default_rng(seed)
    real = run.torque_nm.copy()
    at = int(rng.integers(500, len(real) - 500))
    real[at : at + round(late_s * 1000)] = real[at]
    platform = Platform(*TRUTH, {"coulomb_friction": {"level": 1.0}})
    rate = simulate(platform, run.time_s, TorqueSignal(run.time_s, real), substeps=16).sensed_rate_rad_s
    return replace(run, rate_rad_s=rate + NOISE_RAD_S * rng.standard_normal(len(rate)))


@pytest.mark.parametrize("late_s", [0.002, 0.003])
@pytest.mark.slow
def test_the_friction_is_named_and_every_number_is_right(late_s: float) -> None:
    recording = Recording(tuple(disturbed(*s, late_s, seed=10 + i) for i, s in enumerate(SETS)))
    found = identify(recording, DECLARED, IdentifyConfig.model_validate({"candidates": FEW}))
    assert found.verdict.effects == ("coulomb_friction",)
    assert found.accepted, found.reasons
    assert found.disturbance is not None and found.disturbance.relative < 0.001
    inertia, damping, stiffness = (found.final.parameters[t].value for t in ("inertia", "damping", "stiffness"))
    assert inertia == pytest.approx(TRUTH[0], rel=0.001)
    assert damping == pytest.approx(TRUTH[1], rel=0.02)
    assert stiffness == pytest.approx(TRUTH[2], rel=0.001)
