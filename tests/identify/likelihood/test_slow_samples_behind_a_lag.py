"""A gyro's low-pass that is short against a sample: what it is fed between two samples has to follow the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from identify.simulate.all_runs import COARSEST, PARTS_OF_A_LAG, READ_BIAS, reads_a_sample, shots_for
from identify.simulate.shots import predict
from rig.dynamics import Equations
from rig.platform import TERMS, Platform
from rig.recording.run import Array, Run
from tests.identify.simulated import NOISE_RAD_S, sine_run

LAG_S = 1.2e-3
EVERY = 8  # of a rate at 1 kHz: samples of 8 ms
LAGS = ("sensor_lag", "sensor_lag_second_order")
SOFT = (0.02, 0.05, 5.0)  # rings at 2.5 Hz
SETS = ((1.0, 1.5), (3.0, 5.0))  # Hz, N m


def slow_run(hertz: float, torque_nm: float, seed: int, lag: str) -> Run:
    """A set read at 125 Hz, its torque known at 1 kHz."""
    effects = {lag: {"time": LAG_S}}
    run = sine_run(torque_nm, hertz, seed=seed, duration_s=20.0, effects=effects, jck=SOFT, noise=0.1 * NOISE_RAD_S)
    assert run.rate_rad_s is not None
    return replace(run, time_s=run.time_s[::EVERY], valid=run.valid[::EVERY], rate_rad_s=run.rate_rad_s[::EVERY])


def slow_traces(lag: str) -> list[Trace]:
    return one_noise([prepare(slow_run(f, m, i, lag), i) for i, (f, m) in enumerate(SETS)], False)


@pytest.mark.parametrize("lag", LAGS)
def test_a_lag_shorter_than_a_sample_moves_no_number(lag: str) -> None:
    true = {(k,): v for k, v in zip(TERMS, SOFT, strict=True)} | {(lag, "time"): LAG_S}
    fit = PredictionError(slow_traces(lag)).fit(Structure(effects=(lag,)), true)
    for name, value in true.items():
        assert abs(fit.values[name] - value) < 3.0 * fit.std_error(name), name


@pytest.mark.parametrize("lag", LAGS)
def test_what_a_simulation_feeds_a_lag_is_off_by_less_than_the_noise_of_a_mean(lag: str) -> None:
    """Prediction follows the lag exactly; a simulation has to take finer steps for it than the platform asks for."""
    trace = slow_traces(lag)[0]
    trace = replace(trace, noise=NOISE_RAD_S)
    values = {(k,): v for k, v in zip(TERMS, SOFT, strict=True)} | {(lag, "time"): LAG_S}
    structure, names, x = Structure(effects=(lag,)), list(values), np.array(list(values.values()))
    equations = Equations(Platform(*SOFT, {lag: {"time": LAG_S}}))
    assert 1.0 < reads_a_sample(trace, LAG_S, len(trace.measured)) < COARSEST

    def read(finer: int) -> Array:
        (shots,) = shots_for([trace], structure, names, x, None, None, None, True, finer)
        return predict(shots, equations, np.zeros((1, 2)), 0.0)

    off = float(np.sqrt(np.mean((read(1) - read(16)) ** 2)))
    assert off < trace.noise / np.sqrt(len(trace.measured))


def test_the_rate_is_read_as_often_as_its_bend_and_the_lag_ask_for() -> None:
    trace = slow_traces("sensor_lag")[0]
    samples = 10_000
    quiet, noisy = (reads_a_sample(replace(trace, noise=n), LAG_S, samples) for n in (1e-9, 1e3))
    assert quiet == pytest.approx(PARTS_OF_A_LAG * trace.step_s / LAG_S)  # finer than its own second order needs not
    assert noisy < 1.0
    assert reads_a_sample(trace, LAG_S, 100 * samples) >= reads_a_sample(trace, LAG_S, samples)


def test_a_line_through_two_reads_errs_by_less_than_the_noise_of_a_mean() -> None:
    trace, samples = slow_traces("sensor_lag")[0], 10_000
    between_s = trace.step_s / reads_a_sample(trace, 0.0, samples)
    off = trace.bend_rad_s3 * between_s**2 / 12.0  # mean distance of a parabola from its chord
    assert off == pytest.approx(READ_BIAS * trace.noise / np.sqrt(samples))
