"""A gyro has its own low-pass and a bias that walks, and an encoder may read the same platform beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from identify.likelihood.prediction_error import PredictionError
from identify.likelihood.settling import settled
from identify.model.structure import Structure
from identify.signals.prepare import channels_of, one_noise, prepare
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.platform import TERMS
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run

CORNER_HZ = 180.0
TIME_S = np.sqrt(2.0) / (2.0 * np.pi * CORNER_HZ)
SETS = ((104.0, 3.0), (67.0, 6.0))


def filtered_run(torque_nm: float, hertz: float, seed: int) -> Run:
    """A set whose gyro passes its own noise and the rate through a Butterworth low-pass of second order."""
    run = sine_run(torque_nm, hertz, seed=seed, noise=0.0, effects={"sensor_lag_second_order": {"time": TIME_S}})
    assert run.rate_rad_s is not None
    noise = np.random.default_rng(seed).standard_normal(len(run.time_s))
    sos = signal.butter(2, CORNER_HZ, fs=1000.0, output="sos")
    return replace(run, rate_rad_s=run.rate_rad_s + NOISE_RAD_S * signal.sosfilt(sos, noise))


def fitted(traces: list[Trace], *effects: str):  # type: ignore[no-untyped-def]
    start = {(k,): 1.05 * v for k, v in zip(TERMS, TRUTH, strict=True)}
    start |= {(e, "time"): 0.7 * TIME_S for e in effects}
    return PredictionError(traces).fit(Structure(effects=effects), start)  # type: ignore[arg-type]


def test_behind_the_gyros_low_pass_every_number_is_right_within_its_error() -> None:
    runs = tuple(filtered_run(m, f, i) for i, (m, f) in enumerate(SETS))
    fit = fitted(one_noise([prepare(r, i) for i, r in enumerate(runs)], False), "sensor_lag_second_order")
    for name, truth in zip(TERMS, TRUTH, strict=True):
        assert abs(fit.values[(name,)] - truth) < 4.0 * fit.std_error((name,)), name
    assert fit.values[("sensor_lag_second_order", "time")] == pytest.approx(TIME_S, rel=0.01)


@pytest.mark.parametrize("first", [433, 500])
def test_a_stretch_that_begins_while_the_low_pass_is_in_motion_tells_what_a_run_from_rest_does(first: int) -> None:
    run = sine_run(67.0, 6.0, seed=1, effects={"sensor_lag_second_order": {"time": 2e-3}})
    problem = PredictionError([one_noise([prepare(run)], False)[0].piece(first, first + 1500)])
    true = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)} | {("sensor_lag_second_order", "time"): 2e-3}
    fit = problem.fit(Structure(effects=("sensor_lag_second_order",)), true)
    for name, value in true.items():
        assert abs(fit.values[name] - value) < 4.0 * fit.std_error(name), name
    assert fit.values[("damping",)] == pytest.approx(TRUTH[1], rel=1e-3)
    early = fit.prediction.innovations[0][:, 0] / np.sqrt(fit.prediction.variance[0][:, 0] * fit.variance)
    assert float(np.sqrt(np.mean(early[:20] ** 2))) < 1.5


def test_samples_of_a_cut_stretch_count_once_it_has_settled_and_all_do_from_the_start_of_a_run() -> None:
    whole = one_noise([prepare(sine_run(67.0, 6.0))], False)[0]
    cut = whole.piece(500, 1999)
    for channel in ("rate", "angle"):
        counts = settled([replace(whole, channel=channel), replace(cut, channel=channel)])
        assert counts is not None
        assert np.all(counts[0])
        assert not np.any(counts[1][:300]) and np.all(counts[1][300:])
    assert settled([replace(whole, channel="angle")]) is None


def beside(run: Run, counts: int, seed: int, white: bool = False) -> Run:
    """The same run with an encoder of so many counts, at a platform that begins at zero.

    Errors of rounding go with the motion and look like a torque; those of a ``white`` encoder do not.
    """
    assert run.rate_rad_s is not None
    rng = np.random.default_rng(seed)
    true = np.concatenate([[0.0], np.cumsum(0.5 * (run.rate_rad_s[1:] + run.rate_rad_s[:-1]) * np.diff(run.time_s))])
    step = 2.0 * np.pi / counts
    read = true + step * rng.uniform(-0.5, 0.5, len(true)) if white else true
    angle = np.rint(read / step) * step
    return replace(run, angle_rad=angle, rate_rad_s=run.rate_rad_s + NOISE_RAD_S * rng.standard_normal(len(true)))


@pytest.mark.slow
def test_a_gyro_and_an_encoder_are_read_together_and_know_more_than_either() -> None:
    runs = [beside(sine_run(m, f, seed=i, noise=0.0), 20_000, i, white=True) for i, (m, f) in enumerate(SETS)]
    found = channels_of(runs)
    assert found.both
    both = fitted(one_noise([prepare(r, i, channels=found) for i, r in enumerate(runs)], False))
    alone = [replace(r, angle_rad=None) for r in runs]
    gyro = fitted(one_noise([prepare(r, i) for i, r in enumerate(alone)], False))
    for name, truth in zip(TERMS, TRUTH, strict=True):
        assert abs(both.values[(name,)] - truth) < 4.0 * both.std_error((name,)), name
        assert both.std_error((name,)) < 1.05 * gyro.std_error((name,)), name


@pytest.mark.parametrize("filtered", [False, True])
def test_a_rate_that_was_made_from_the_encoder_is_no_second_reading(filtered: bool) -> None:
    runs = []
    for i, (m, f) in enumerate(SETS):
        run = beside(sine_run(m, f, seed=i, noise=0.0), 20_000, i)
        assert run.angle_rad is not None
        rate: Array = np.gradient(run.angle_rad, run.time_s)
        if filtered:
            rate = np.asarray(signal.lfilter([0.3], [1.0, -0.7], rate))
        runs.append(replace(run, rate_rad_s=rate))
    assert not channels_of(runs).both


def test_all_runs_are_read_by_the_same_channel() -> None:
    runs = [beside(sine_run(m, f, seed=i, noise=0.0), 20_000, i) for i, (m, f) in enumerate(SETS)]
    assert channels_of([runs[0], replace(runs[1], rate_rad_s=None)]).first == "angle"
    assert channels_of([runs[0], replace(runs[1], angle_rad=None)]).first == "rate"


def test_stamps_of_a_software_loop_that_wander_by_two_samples_cost_nothing() -> None:
    runs = []
    for i, (m, f) in enumerate(SETS):
        run = sine_run(m, f, seed=i, noise=0.0, duration_s=6.0)
        assert run.rate_rad_s is not None and run.torque_nm is not None
        n = len(run.time_s)
        wander = 2e-3 * np.sin(2.0 * np.pi * 3.0 * np.arange(n) / n)
        keep = slice(10, n - 10)
        at = run.time_s[keep] + wander[keep]
        noise = NOISE_RAD_S * np.random.default_rng(i).standard_normal(len(at))
        rate = np.interp(at, run.time_s, run.rate_rad_s) + noise
        torque = m * np.sin(2.0 * np.pi * f * at)
        runs.append(replace(run, time_s=at, valid=run.valid[keep], rate_rad_s=rate, torque_nm=torque, torque_time_s=at))
    traces = one_noise([prepare(r, i) for i, r in enumerate(Recording(tuple(runs)).runs)], False)
    assert min(float(np.mean(t.keep)) for t in traces) > 0.98
    fit = fitted(traces)
    assert fit.values[("inertia",)] == pytest.approx(TRUTH[0], rel=2e-3)
    assert fit.values[("stiffness",)] == pytest.approx(TRUTH[2], rel=2e-3)


def test_a_stretch_from_the_middle_of_a_run_begins_where_the_bias_has_left_the_angle() -> None:
    bend = {"bilinear_stiffness": {"step": 0.2 * TRUTH[2]}}
    run = sine_run(104.0, 3.0, seed=3, duration_s=12.0, bias=0.05, effects=bend)
    whole = one_noise([prepare(run, 0)], False)[0]
    cut = whole.piece(9_000, len(whole.measured) - 1)
    start = {(k,): 1.05 * v for k, v in zip(TERMS, TRUTH, strict=True)}
    fit = PredictionError([cut]).fit(Structure(effects=("bilinear_stiffness",)), start)  # type: ignore[arg-type]
    assert fit.shots[0].bias == pytest.approx(0.05, abs=2e-3)
    for name, truth in zip(TERMS, TRUTH, strict=True):
        assert abs(fit.values[(name,)] - truth) < 4.0 * fit.std_error((name,)), name
    assert fit.values[("bilinear_stiffness", "step")] == pytest.approx(0.2 * TRUTH[2], rel=0.02)
