"""Noise of the current sensor moves no platform, and must not pass for inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.signals.torque_noise import quieter
from rig.arrays import Array
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run, traces_of, white

SETS = ((104.0, 3.0), (67.0, 6.0))
JCK = {(term,): value for term, value in zip(TERMS, TRUTH, strict=True)}


def noisy(share: float) -> tuple[Run, ...]:
    """Sets whose torque was read with white noise, a share of its amplitude."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(SETS):
        run = sine_run(torque_nm, hertz, seed=seed)
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), share * torque_nm, 50 + seed)))
    return tuple(runs)


def test_noise_goes_and_the_torque_stays() -> None:
    found = quieter(traces_of(Recording(noisy(0.02))))
    assert found is not None
    traces, noise_nm = found
    assert noise_nm == pytest.approx(0.02 * np.mean([torque_nm for torque_nm, _ in SETS]), rel=0.05)
    for trace, (torque_nm, hertz) in zip(traces, SETS, strict=True):
        assert trace.torque is not None
        true = torque_nm * np.sin(2.0 * np.pi * hertz * trace.torque.time_s)
        assert np.std((trace.torque.torque_nm - true)[300:-300]) < 0.4 * 0.02 * torque_nm


def test_a_step_keeps_its_edge() -> None:
    """What a filter of the whole run would round, or leave noisy: a step has all frequencies, and only at its place."""
    time: Array = np.arange(8000) * 1e-3
    true = 10.0 * np.sign(np.sin(2.0 * np.pi * 0.4 * time + 0.1))
    read = true + white(len(time), 0.3)
    run = Run("steps", time, np.ones(len(time), bool), rate_rad_s=true, torque_time_s=time, torque_nm=read)
    found = quieter(traces_of(Recording((run,))))
    assert found is not None
    (trace,), _ = found
    assert trace.torque is not None
    wrong = trace.torque.torque_nm - true
    near = np.zeros(len(time), bool)
    for k in np.flatnonzero(np.diff(true)):
        near[k - 15 : k + 16] = True
    assert np.sqrt(np.mean(wrong[~near] ** 2)) < 0.3 * 0.3
    assert np.sqrt(np.mean(wrong[near] ** 2)) < 1.5 * 0.3  # of a step of 20


def test_a_filtered_torque_is_not_filtered_again() -> None:
    found = quieter(traces_of(Recording(noisy(0.02))))
    assert found is not None and quieter(found[0]) is None


READING_NM = 0.3  # of a torque of some 30


def behind_a_low_pass(time: Array) -> Run:
    """A platform that is stepped about, its torque read with noise, its gyro behind a Butterworth low-pass of 80 Hz."""
    per, step_s = 20, float(time[1] - time[0])
    fine: Array = np.arange(per * (len(time) - 1) + 1) * step_s / per
    levels = np.random.default_rng(3).uniform(-60.0, 60.0, 100)
    drive = butter(2, 12.0, fs=per / step_s)
    torque = lfilter(*drive, levels[(fine / 0.13).astype(int)])
    rate = simulate(Platform(*TRUTH), fine, TorqueSignal(fine, torque)).rate_rad_s
    seen = lfilter(*butter(2, 80.0, fs=per / step_s), rate)[::per]
    read = torque[::per] + white(len(time), READING_NM, 5)
    return Run(
        "steps", time, np.ones(len(time), bool), rate_rad_s=seen + white(len(time), NOISE_RAD_S, 6),
        torque_time_s=time, torque_nm=read,
    )  # fmt: skip


def test_noise_of_the_torque_does_not_pass_for_damping() -> None:
    """Noise of the torque looks like lost gain: the damping came out 19 % too low, the inertia 0.2 % too high."""
    found = quieter(traces_of(Recording((behind_a_low_pass(np.arange(2400) * 4e-3),))))
    assert found is not None
    lag = "sensor_lag_second_order"
    fit = PredictionError(found[0]).fit(
        Structure(effects=(lag,)), {**JCK, (lag, "time"): 2e-3}, iterations=40, thorough=False
    )
    assert fit.values[("inertia",)] == pytest.approx(TRUTH[0], rel=1e-3)
    assert fit.values[("damping",)] == pytest.approx(TRUTH[1], rel=0.04)


def test_a_torque_without_noise_stays_as_it_is() -> None:
    assert quieter(traces_of(Recording(noisy(0.0)))) is None


def test_a_torque_that_never_changes_has_no_noise() -> None:
    """Of nothing no share is noise: what was left of it had been not a number."""
    still = tuple(replace(run, torque_nm=np.full(len(run.time_s), 5.0)) for run in noisy(0.0))
    assert quieter(traces_of(Recording(still))) is None


def test_a_commanded_torque_is_known_and_stays_as_it_is() -> None:
    held = tuple(replace(run, torque_hold="zero_order") for run in noisy(0.02))
    assert quieter(traces_of(Recording(held))) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "offered"),
    [
        (0.01, ("coulomb_friction", "torque_delay", "cubic_stiffness", "flexible_mode")),
        pytest.param(0.01, None, marks=pytest.mark.slow),  # the whole library
        pytest.param(0.05, None, marks=pytest.mark.slow),
    ],
)
def test_noise_in_the_recorded_torque_does_not_pass_for_inertia(share: float, offered: tuple[str, ...] | None) -> None:
    """As it was recorded the likelihood finds five times the inertia."""
    found = identify(Recording(noisy(share)), Platform(*TRUTH), IdentifyConfig(candidates=offered))
    assert found.verdict.effects == ()
    assert found.accepted, found.reasons
    assert found.final.parameters["inertia"].value == pytest.approx(TRUTH[0], rel=0.02)
    assert found.final.parameters["stiffness"].value == pytest.approx(TRUTH[2], rel=0.01)
    assert "noise that the platform does not follow" in found.holdout_note
