"""A second mass that shows within a few percent of its frequency is found by that, whatever the frequency is."""

from __future__ import annotations

import numpy as np
import pytest

from identify.signals.prepare import prepare
from identify.signals.resonances import MODE_RATIO, resonances_hz
from identify.signals.trace import UPSAMPLING, Trace
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Run

JCK = (30.0, 60.0, 9000.0)


def swept(mode_hz: float, share: float) -> tuple[Trace, Array]:
    """A chirp across the mode, and the torque that J, C and K of the platform without it leave."""
    time = np.arange(10_001) * 2e-3
    phase = 2.0 * np.pi * (0.5 * time + 14.5 / 40.0 * time**2)
    torque = TorqueSignal(time, 400.0 * np.sin(phase))
    effects = {"flexible_mode": {"inertia": share * JCK[0], "frequency": mode_hz, "ratio": 0.02}} if share else {}
    moved = simulate(Platform(*JCK, effects), time, torque, substeps=8)
    noise = 5e-4 * np.random.default_rng(3).standard_normal(len(time))
    run = Run(
        "chirp", time, np.ones(len(time), bool), rate_rad_s=moved.sensed_rate_rad_s + noise, torque_time_s=time,
        torque_nm=torque.torque_nm,
    )  # fmt: skip
    trace = prepare(run)
    angle, rate = (x[::UPSAMPLING] for x in trace.fine[:2])
    left = torque.torque_nm - JCK[0] * np.gradient(rate, 2e-3) - JCK[1] * rate - JCK[2] * angle
    return trace, left


@pytest.mark.parametrize("mode_hz", [5.1, 7.3, 9.0, 11.8])
def test_a_narrow_mode_is_found_wherever_it_lies(mode_hz: float) -> None:
    trace, left = swept(mode_hz, 0.016)
    assert resonances_hz([trace], [left])[0] == pytest.approx(mode_hz, rel=MODE_RATIO)


def test_several_runs_are_looked_at_together() -> None:
    quiet, (swept_trace, left) = swept(9.0, 0.0), swept(9.0, 0.016)
    assert resonances_hz([quiet[0], swept_trace], [quiet[1], left])[0] == pytest.approx(9.0, rel=MODE_RATIO)


def test_a_run_of_which_nothing_is_kept_shows_none() -> None:
    trace, left = swept(9.0, 0.016)
    assert resonances_hz([trace], [np.full_like(left, np.nan)]) == ()
