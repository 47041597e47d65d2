"""A torque that repeats with the motion stands at spectral lines; one at random does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.select.disturbance_lines import lines_left
from identify.signals.prepare import one_noise, prepare
from identify.signals.torque_noise import quieter
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run, white

SETS = ((100.0, 1.0), (95.0, 3.0), (40.0, 9.0))
STEP_NM = 8.0


def fitted(
    shaft: Callable[[Array, int], Array],
    folded: Callable[[Array, int], Array] = lambda time, number: 0.0 * time,
    reading_nm: float = 0.0,
) -> tuple[Fit, float]:
    """J, C and K fitted to runs whose torque at the shaft is not the recorded one, and the size of that torque.

    ``folded`` is a rate that the gyro shows besides; ``reading_nm`` noise of the recorded torque, which is filtered.
    """
    runs = []
    for number, (torque_nm, frequency_hz) in enumerate(SETS):
        run = sine_run(torque_nm, frequency_hz, duration_s=5.0)
        assert run.torque_nm is not None
        applied = TorqueSignal(run.time_s, shaft(run.torque_nm, number))
        rate = simulate(Platform(*TRUTH), run.time_s, applied, substeps=16).rate_rad_s
        noise = NOISE_RAD_S * np.random.default_rng(number).standard_normal(len(rate))
        read_nm = run.torque_nm + white(len(rate), reading_nm, 20 + number)
        runs.append(replace(run, rate_rad_s=rate + noise + folded(run.time_s, number), torque_nm=read_nm))
    traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
    quiet = quieter(traces) if reading_nm else None
    problem = PredictionError(traces if quiet is None else quiet[0])
    assert problem.traces[0].torque_is_filtered == (reading_nm > 0.0)
    return problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}), problem.torque_nm


def in_steps(torque: Array, number: int) -> Array:
    return STEP_NM * np.rint(torque / STEP_NM)


def at_random(torque: Array, number: int) -> Array:
    steps = white(len(torque), seed=10 + number)
    return torque + 0.4 * steps + lfilter([1.0], [1.0, -0.98], 0.2 * steps)


def test_a_torque_that_is_sent_in_coarse_steps_is_seen_at_its_lines() -> None:
    fit, torque_nm = fitted(in_steps)
    found = lines_left(fit, torque_nm)
    assert found is not None
    assert found.on == "frequency"
    assert 0.2 * STEP_NM < found.torque_rms < STEP_NM  # evenly spread over a step it is the step over the root of 12
    assert found.relative == pytest.approx(found.torque_rms / torque_nm)


def test_noise_of_the_torque_that_its_filter_lets_through_is_no_line() -> None:
    """The filter leaves it around the frequencies of the sets alone."""
    assert lines_left(*fitted(lambda torque, number: torque, reading_nm=3.0)) is None
    found = lines_left(*fitted(in_steps, reading_nm=3.0))
    assert found is not None
    assert 0.1 * STEP_NM < found.torque_rms < STEP_NM


def test_a_vibration_that_the_gyro_folds_back_is_seen_though_no_torque_follows_it() -> None:
    def folded(time: Array, number: int) -> Array:
        return 0.003 * np.sin(2.0 * np.pi * 97.3 * time + number)

    def slowly(torque: Array, number: int) -> Array:
        return torque + lfilter(
            [0.0005], [1.0, -1.998, 0.998001], np.random.default_rng(number).standard_normal(len(torque))
        )

    fit, torque_nm = fitted(slowly, folded)
    found = lines_left(fit, torque_nm)
    assert found is not None
    assert found.relative < 0.005


@pytest.mark.parametrize("shaft", [at_random, lambda torque, number: torque])
def test_neither_a_random_torque_nor_noise_alone_stands_at_lines(shaft: Callable[[Array, int], Array]) -> None:
    assert lines_left(*fitted(shaft)) is None
