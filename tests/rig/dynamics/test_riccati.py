"""The Kalman gains that leap over what changes smoothly, beside those of a recursion sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from rig.arrays import Array
from rig.dynamics.gains import BIAS, RATE, STATES, Noise, Sensing, StartVariance, _discrete, gains_of
from rig.dynamics.linear_part import LinearPart

JCK = np.array([0.02, 0.045, 680.0])
STEP_S, SAMPLES = 1e-3, 6000
NOISE = Noise(white=2e-3, slow=300.0, time_constant_s=0.3, walk=1e-7, smooth=50.0)
BEGUN = StartVariance(angle=4.0, rate=1e3)
GYRO = Sensing(True, bias_variance=100.0)
ENCODER_BESIDE = Sensing(True, angle_variance=0.01, bias_variance=100.0)


def sample_by_sample(noise: Noise, sensing: Sensing, keep: Any, begun: StartVariance) -> tuple[Array, Array]:
    """Gains and innovation variances as the textbook has them (Anderson and Moore, Optimal Filtering, ch. 3)."""
    phi, q = _discrete(LinearPart(*JCK.tolist()), noise, sensing.lag, STEP_S)
    start = np.zeros((STATES, STATES))
    start[0, 0], start[1, 1] = begun.angle, begun.rate
    start[2:4, 2:4] = noise.coloured
    start[BIAS, BIAS] = sensing.bias_variance
    rows = [np.eye(STATES)[RATE] + np.eye(STATES)[BIAS]]
    variances = [1.0]
    if sensing.angle_variance:
        rows.append(np.eye(STATES)[0])
        variances.append(sensing.angle_variance)
    gain, variance = np.zeros((len(keep), len(rows), STATES)), np.ones((len(keep), len(rows)))
    p = start
    for i, kept in enumerate(keep):
        for k, (row, own) in enumerate(zip(rows, variances, strict=True)):
            variance[i, k] = row @ p @ row + own
            if kept:
                gain[i, k] = p @ row / variance[i, k]
                p = p - np.outer(gain[i, k], p @ row)
        p = phi @ p @ phi.T + q
        p = 0.5 * (p + p.T)
    return gain, variance


@pytest.mark.parametrize("sensing", [GYRO, ENCODER_BESIDE], ids=["gyro", "encoder beside it"])
@pytest.mark.parametrize(
    "noise",
    [NOISE, Noise(white=1e-6, slow=1e-9, walk=1e-12), Noise(white=1e3, slow=1e6, time_constant_s=0.01, walk=1e-3)],
    ids=["some", "next to none", "much"],
)
@pytest.mark.parametrize("lost", [(), (700, 2500, 2501, 2502)], ids=["whole", "samples lost"])
def test_gains_are_those_of_the_recursion_sample_by_sample(noise: Noise, sensing: Sensing, lost: Any) -> None:
    keep = np.ones(SAMPLES, dtype=bool)
    keep[list(lost)] = False
    found = gains_of(LinearPart(*JCK), noise, STEP_S, sensing, keep, [(0, SAMPLES - 1)], BEGUN)
    gain, variance = sample_by_sample(noise, sensing, keep, BEGUN)
    np.testing.assert_allclose(found.variance, variance, rtol=1e-6)
    size = np.max(np.abs(gain[100:]), axis=0)  # of each gain, once the start is over
    assert np.all(np.abs(found.gain - gain)[100:] <= 1e-3 * size)


def test_gains_settle_on_the_algebraic_equation() -> None:
    quick = Noise(white=1.0, slow=1e4, time_constant_s=0.02)
    keep = np.ones(SAMPLES, dtype=bool)
    found = gains_of(LinearPart(*JCK), quick, STEP_S, Sensing(True), keep, [(0, SAMPLES - 1)], BEGUN)
    phi, q = _discrete(LinearPart(*JCK.tolist()), quick, (0.0, 0.0), STEP_S)
    there = [0, 1, 2, 3]
    row = np.array([[0.0, 1.0, 0.0, 0.0]])
    p = solve_discrete_are(phi[np.ix_(there, there)].T, row.T, q[np.ix_(there, there)], np.eye(1))
    settled = (p @ row.T / (row @ p @ row.T + 1.0)).ravel()
    np.testing.assert_allclose(found.gain[-1, 0, there], settled, rtol=1e-4)


def test_a_platform_that_runs_away_is_followed_by_its_sensor() -> None:
    keep = np.ones(SAMPLES, dtype=bool)
    falling = np.array([0.02, -0.5, -680.0])
    found = gains_of(LinearPart(*falling), NOISE, STEP_S, GYRO, keep, [(0, SAMPLES - 1)], BEGUN)
    assert np.all(np.isfinite(found.gain)) and np.all(found.variance >= 1.0)


@pytest.mark.parametrize("lag_s", [1e-5, 1e-4, 1e-3])
def test_a_low_pass_far_faster_than_a_sample_hides_nothing(lag_s: float) -> None:
    noise, step_s = Noise(white=50.0, slow=300.0, time_constant_s=0.2, ahead=1e-9), 0.02
    keep, spans = np.ones(200, bool), [(0, 199)]
    part = LinearPart(*JCK)
    quick = gains_of(part, noise, step_s, Sensing(True, 0.0, (lag_s, 0.0)), keep, spans, BEGUN)
    without = gains_of(part, noise, step_s, Sensing(True), keep, spans, BEGUN)
    assert quick.variance[-1, 0] == pytest.approx(without.variance[-1, 0], rel=20.0 * lag_s / step_s)


def test_noise_ahead_of_a_quick_low_pass_is_white_noise_as_large_as_it_comes_through() -> None:
    noise, keep, spans = Noise(white=1e-12, ahead=3.0), np.ones(50, bool), [(0, 49)]
    still = gains_of(LinearPart(*JCK), noise, 0.02, Sensing(True, 0.0, (1e-7, 0.0)), keep, spans)
    second = gains_of(LinearPart(*JCK), noise, 0.02, Sensing(True, 0.0, (1e-7, 0.5e-14)), keep, spans)
    assert still.variance[-1, 0] == pytest.approx(1.0 + 3.0, rel=1e-3)
    assert second.variance[-1, 0] == pytest.approx(1.0 + 3.0, rel=1e-3)


def test_numbers_that_are_no_platform_predict_nothing_and_stop_nothing() -> None:
    gains = gains_of(
        LinearPart(1.0, 0.1, np.nan), Noise(white=0.1), 1e-3, Sensing(True), np.ones(200, dtype=bool), [(0, 199)]
    )
    assert not np.any(np.isfinite(gains.variance[1:]))
