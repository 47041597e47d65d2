"""The coloured torque disturbance: two states carry a rough part and a smooth one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.dynamics.gains import AIM, RATE, TORQUE, Noise, Sensing, gains_of, innovations_with
from rig.dynamics.linear_part import LinearPart
from rig.dynamics.predictor import predict_ahead
from rig.platform import Platform
from tests.rig.dynamics.test_predictor import JCK, SIGMA, STEP, TIME, innovations

SLOW, SMOOTH, TIME_S = 3.0, 5.0, 0.2
BOTH = Noise(slow=SLOW, smooth=SMOOTH, time_constant_s=TIME_S)


def response(noise: Noise, w: Array) -> Array:
    """Spectral density of the coloured torque at angular frequencies, two-sided."""
    f = np.array([[-1.0, 1.0], [0.0, -1.0]]) / noise.time_constant_s
    kicks = np.array(noise.kicks)
    return np.array([abs(np.linalg.solve(1j * x * np.eye(2) - f, kicks)[0]) ** 2 for x in w])


def test_the_spectrum_is_the_sum_of_the_rough_and_the_smooth_one() -> None:
    w = np.geomspace(0.1, 1e3, 60)
    low_pass = 1.0 / (1.0 + (w * TIME_S) ** 2)
    assert response(BOTH, w) == pytest.approx(2.0 * TIME_S * SLOW * low_pass + 4.0 * TIME_S * SMOOTH * low_pass**2)


@pytest.mark.parametrize("noise", [BOTH, Noise(slow=SLOW, time_constant_s=TIME_S), Noise(smooth=2.0)])
def test_its_covariance_is_the_stationary_one_and_its_variance_the_sum_of_both(noise: Noise) -> None:
    f = np.array([[-1.0, 1.0], [0.0, -1.0]]) / noise.time_constant_s
    kicks = np.array(noise.kicks)
    assert noise.coloured == pytest.approx(solve_continuous_lyapunov(f, -np.outer(kicks, kicks)), abs=1e-12)
    assert noise.coloured[0, 0] == pytest.approx(noise.slow + noise.smooth)


def test_a_rough_torque_alone_heads_for_nothing() -> None:
    noise = Noise(slow=SLOW, time_constant_s=TIME_S)
    keep = np.ones(len(TIME), dtype=bool)
    gains = gains_of(LinearPart(*JCK), noise, STEP, Sensing(False, 1.0), keep, [(0, len(TIME) - 1)])
    assert np.any(gains.gain[:, 0, TORQUE] != 0.0)
    assert gains.gain[:, 0, AIM] == pytest.approx(0.0, abs=1e-9)
    assert gains.coloured[0, 0] == pytest.approx(np.exp(-STEP / TIME_S))


def smoothly_disturbed(size_nm: float) -> tuple[Array, Array]:
    """Recorded torque and measured angle of a linear platform that a smooth torque pushes, too, computed exactly."""
    rng = np.random.default_rng(3)
    inertia, damping, stiffness = JCK
    noise = Noise(smooth=size_nm**2, time_constant_s=0.05)
    f = np.zeros((4, 4))
    f[0, 1], f[1, :3] = 1.0, (-stiffness / inertia, -damping / inertia, 1.0 / inertia)
    f[2, 2], f[2, 3], f[3, 3] = -1.0 / 0.05, 1.0 / 0.05, -1.0 / 0.05
    density = np.zeros((4, 4))
    density[2:, 2:] = np.outer(noise.kicks, noise.kicks)
    big = expm(np.block([[-f, density], [np.zeros((4, 4)), f.T]]) * STEP)
    phi = big[4:, 4:].T
    values, vectors = np.linalg.eigh(phi @ big[:4, 4:])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    torque = np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 4.1 * TIME)
    # A torque that is held over a sample moves angle and rate as a constant state would.
    held = np.zeros((3, 3))
    held[0, 1], held[1] = 1.0, (-stiffness / inertia, -damping / inertia, 1.0 / inertia)
    pushed = expm(held * STEP)[:2, 2]
    state, angle = np.zeros(4), np.zeros(len(TIME))
    for i in range(len(TIME)):
        angle[i] = state[0]
        state = phi @ state + root @ rng.standard_normal(4)
        state[:2] += pushed * torque[i]
    return torque, angle + SIGMA * rng.standard_normal(len(TIME))


def largest_correlation(left: Array) -> float:
    return max(abs(float(left[k:] @ left[:-k])) / float(left @ left) for k in range(1, 6))


def test_behind_the_right_smooth_torque_the_innovations_are_white_and_behind_a_rough_one_they_are_not() -> None:
    torque, angle = smoothly_disturbed(0.3)
    size = 0.3**2 / SIGMA**2
    smooth = innovations(torque, angle, Noise(smooth=size, time_constant_s=0.05))
    assert np.sqrt(np.mean(smooth**2)) == pytest.approx(SIGMA, rel=0.05)
    assert largest_correlation(smooth) < 4.0 / np.sqrt(len(smooth))
    assert largest_correlation(innovations(torque, angle, Noise(slow=size, time_constant_s=0.05))) > 0.1


def test_what_other_gains_do_is_followed_without_a_prediction() -> None:
    torque, angle = smoothly_disturbed(0.3)
    keep, spans = np.ones(len(TIME), dtype=bool), [(0, len(TIME) - 1)]
    equations = Equations(Platform(*JCK))
    grid = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8)

    def predicted(noise: Noise):  # type: ignore[no-untyped-def]
        gains = gains_of(LinearPart(*JCK), noise, STEP, Sensing(False, 1.0), keep, spans)
        out, state = predict_ahead(
            equations, grid.shaft_torque(equations), grid.step_s, 8, spans, np.zeros((1, 2)), angle[:, None], keep,
            gains, False, 0.0,
        )  # fmt: skip
        return gains, angle[:, None] - out, state

    here, e, state = predicted(Noise(slow=1e4, smooth=1e6, time_constant_s=0.05))
    there, other, _ = predicted(Noise(slow=3e4, smooth=5e5, time_constant_s=0.08))
    followed = innovations_with(here, there, e, state, keep, spans)
    assert np.max(np.abs(other - e)) > 10.0 * np.max(np.abs(followed - other))
    assert np.any(here.gain[:, 0, RATE] != there.gain[:, 0, RATE])
