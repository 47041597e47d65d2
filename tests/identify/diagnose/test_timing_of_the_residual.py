"""A delay or a lag of a fraction of a sample, seen in the residual in torque where the torque is held."""

from __future__ import annotations

import numpy as np
import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.signals.prepare import one_noise, prepare
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Run

JCK = (33.5, 25.0, 8960.0)
STEP_S, SECONDS, CUTOFF_HZ = 4e-3, 20.0, 20.0
HERTZ = (0.8, 1.7, 2.3, 3.6, 4.5, 5.7)


def _run(effects: dict[str, dict[str, float]], encoder: bool, seed: int) -> Run:
    """A multisine torque, held between samples as a drive holds its command."""
    rng = np.random.default_rng(seed)
    time = STEP_S * np.arange(round(SECONDS / STEP_S))
    torque = 60.0 * np.sin(2.0 * np.pi * np.outer(time, HERTZ) + rng.uniform(0.0, 6.0, len(HERTZ))).sum(axis=1)
    motion = simulate(Platform(*JCK, effects), time, TorqueSignal(time, torque, "zero_order"), (0.0, 0.0), substeps=16)
    return Run(
        "multisine", time, np.ones(len(time), bool), rate_rad_s=motion.sensed_rate_rad_s,
        angle_rad=motion.angle_rad if encoder else None, torque_time_s=time, torque_nm=torque, torque_hold="zero_order",
    )  # fmt: skip


def _left_over_torque(effects: dict[str, dict[str, float]], encoder: bool, delay_s: float) -> float:
    """What J, C, K and a delay of the torque leave of it."""
    traces = one_noise([prepare(_run(effects, encoder, i), i) for i in range(2)], False)
    regression = TorqueRegression(traces, split(traces), CUTOFF_HZ, scale_of(traces, JCK, ()))
    shapes = {"torque_delay": (delay_s,)} if delay_s else {}
    fit = regression.solve(Structure(effects=tuple(shapes)), shapes)
    return float(fit.held_nm / regression.torque_nm)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.4, 0.6, 0.9])
def test_a_delay_of_a_part_of_a_sample_leaves_nothing_with_that_delay(share: float) -> None:
    delay_s = share * STEP_S
    late = {"torque_delay": {"delay": delay_s}}
    assert _left_over_torque(late, False, delay_s) < 0.1 * _left_over_torque(late, False, 0.0)


@pytest.mark.parametrize("encoder", [False, True], ids=["gyro", "gyro and encoder"])
def test_a_lag_of_the_gyro_leaves_what_a_torque_as_late_takes_away(encoder: bool) -> None:
    """The angle of an encoder is not late, and J, C and K have to meet rate and angle of one instant."""
    lag = {"sensor_lag": {"time": 6e-4}}
    assert _left_over_torque(lag, encoder, 6e-4) < 0.1 * _left_over_torque(lag, encoder, 0.0)
