"""A drive that gives less torque as it warms up is told by the load that went before."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from identify.conclude.next_steps import next_steps
from identify.conclude.verdict import residual_torque_sentence
from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.residual import Disturbance
from identify.runs.holdout import split
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, NOISE_RAD_S, TRUTH, traces_of

TONES_HZ, WARMING_S, DURATION_S = (0.6, 1.7, 4.3, 7.9), 0.9, 10.0


def run_with(loss: float, number: int) -> Run:
    """Bursts of a multisine at 1 kHz, of which a drive that warms up passes on a part."""
    j, c, k = TRUTH
    h, t = 0.5e-3, np.arange(round(2000 * DURATION_S) + 1) * 0.5e-3
    burst = 0.3 + 0.7 * (np.sin(2 * np.pi * 0.21 * t + 2.0 * number) > 0.0)
    asked = 30.0 * burst * sum(np.sin(2 * np.pi * f * t + 1.3 * i + number) for i, f in enumerate(TONES_HZ))
    kept = float(np.exp(-h / WARMING_S))
    heat = lfilter([1.0 - kept], [1.0, -kept], asked**2 / np.mean(asked**2))
    torque = asked * (1.0 - loss * heat)
    angle = rate = 0.0
    rates = np.zeros(len(t))
    for n in range(len(t) - 1):  # semi-implicit midpoint, two steps a sample
        middle = 0.5 * (torque[n] + torque[n + 1])
        for _ in range(2):
            rate += 0.5 * h * (middle - c * rate - k * angle) / j
            angle += 0.5 * h * rate
        rates[n + 1] = rate
    read = rates[::2] + NOISE_RAD_S * np.random.default_rng(number).standard_normal(len(t[::2]))
    time = t[::2]
    return Run(
        f"run {number}", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time, torque_nm=asked[::2]
    )


def left_of(loss: float) -> Disturbance:
    traces = traces_of(Recording(tuple(run_with(loss, i) for i in range(2))))
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    return disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m")


def test_the_gain_of_a_drive_that_warms_up_is_told_by_its_history() -> None:
    left = left_of(0.1)
    most = left.depends_on[0]
    assert (most.on, most.changes) == ("history", "gain of the drive")
    assert most.relative > 0.9 * left.relative
    said = residual_torque_sentence(left, "rotary")
    assert "depends on the past torque (as if the gain of the drive changed with it)" in said


def test_a_drive_that_stays_as_it_is_has_no_history() -> None:
    assert not left_of(0.0).depends_on


def test_what_to_do_about_a_drive_that_warms_up_is_said() -> None:
    found = identify(Recording(tuple(run_with(0.1, i) for i in range(2))), DECLARED, IdentifyConfig(candidates=()))
    assert found.verdict.unexplained
    assert any("motor that warms up" in step for step in next_steps(found))
