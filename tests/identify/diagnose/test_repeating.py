"""What repeats with the excitation at multiples that it does not play is no noise: no linear model makes it."""

from __future__ import annotations

import numpy as np

from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.terms.repeating import _unplayed_hz, repeating
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.runs.holdout import split
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.recording.run import Recording, Run
from tests.identify.simulated import traces_of

INERTIA, DAMPING, STIFFNESS = 0.02, 0.05, 20.0
SWINGS = ((1.0, 0.2), (2.2, 0.1), (4.0, 0.05))  # Hz, rad


def sagging(hz: float, travel_rad: float, share: float, seed: int) -> Run:
    """A steady swing whose recorded torque has a third multiple less than its motion takes, by a share of it."""
    rng = np.random.default_rng(seed)
    time = np.arange(8001) * 1e-3
    w = 2.0 * np.pi * hz
    angle, rate = travel_rad * np.sin(w * time), travel_rad * w * np.cos(w * time)
    torque = (STIFFNESS - INERTIA * w**2) * angle + DAMPING * rate
    size = float(np.std(torque))
    # The motion at the third multiple that a torque of this size makes and that was not recorded.
    extra = share * size * np.sqrt(2.0)
    answer = 1.0 / (STIFFNESS - INERTIA * (3.0 * w) ** 2 + 1j * DAMPING * 3.0 * w)
    rate = rate + np.real(1j * 3.0 * w * answer * extra * np.exp(1j * 3.0 * w * time))
    slow = 2e-3 * size * rng.standard_normal(len(time))
    read = rate + 1e-3 * rng.standard_normal(len(time))
    return Run(
        f"{hz:g} Hz", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time, torque_nm=torque + slow
    )


def regression(share: float) -> TorqueRegression:
    traces: list[Trace] = traces_of(Recording(tuple(sagging(*s, share, k) for k, s in enumerate(SWINGS))))
    return TorqueRegression(traces, split(traces, "auto"), 25.0, scale_of(traces, (INERTIA, DAMPING, STIFFNESS), ()))


def left(share: float) -> Disturbance:
    along = regression(share)
    fit = along.solve(Structure(), {})
    return disturbance_of(along, fit, along.noise_floor_nm(fit.values), "N*m")


def test_a_third_multiple_of_a_hundredth_is_found_and_moves_no_parameter() -> None:
    found = left(0.01)
    parts = {d.on: d for d in found.depends_on}
    assert "frequency" in parts or "angle" in parts or "rate" in parts
    assert max(d.relative for d in found.depends_on) > 0.004


def test_a_torque_noise_repeats_at_no_multiple() -> None:
    assert left(0.0).depends_on == ()


def test_the_multiples_are_those_that_are_not_played_below_the_low_pass() -> None:
    time: Array = np.arange(8001) * 1e-3
    torque = np.sin(2.0 * np.pi * time) + 0.3 * np.sin(2.0 * np.pi * 3.0 * time)
    rate = np.cos(2.0 * np.pi * time)
    run = Run("two tones", time, np.ones(len(time), bool), rate_rad_s=rate, torque_time_s=time, torque_nm=torque)
    (trace,) = traces_of(Recording((run,)))
    assert np.allclose(_unplayed_hz(trace, 6.5), [2.0, 4.0, 5.0, 6.0], atol=0.01)


def test_a_torque_that_does_not_repeat_has_none() -> None:
    rng = np.random.default_rng(0)
    time: Array = np.arange(4001) * 1e-3
    run = Run(
        "noise", time, np.ones(len(time), bool), rate_rad_s=np.sin(time), torque_time_s=time,
        torque_nm=rng.standard_normal(len(time)),
    )  # fmt: skip
    traces: list[Trace] = traces_of(Recording((run,)))
    along = TorqueRegression(traces, split(traces, "auto"), 25.0, scale_of(traces, (INERTIA, DAMPING, STIFFNESS), ()))
    assert repeating(along) == []
