"""The prefilter answers piecewise polynomials exactly, and is the spectral factor that it claims to be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PPoly
from scipy.linalg import expm

from identify.signals.prefilter import Denominator, Prefilter, held_pieces, linear_pieces, smooth_pieces
from rig.recording.run import Array
from tests.identify.simulated import white

D = Denominator(0.02, 0.045, 677.3)
STEP_S = 1e-3


def exact(pieces: Array, step_s: float) -> Array:
    """1/D and s/D of a piecewise polynomial by an adaptive integrator, piece by piece, shape (pieces + 1, 2)."""
    signal = PPoly(pieces[:, ::-1].T, step_s * np.arange(len(pieces) + 1))
    x, out = np.zeros(2), [np.zeros(2)]
    for a, b in zip(signal.x[:-1], signal.x[1:], strict=True):
        inside = np.nextafter(b, a)

        def slope(t: float, y: Array, last: float = inside) -> list[float]:
            return [y[1], (float(signal(min(t, last))) - D.damping * y[1] - D.stiffness * y[0]) / D.inertia]

        x = solve_ivp(slope, (a, b), x, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize(
    ("pieces", "upsampling"),
    [
        (smooth_pieces(white(81), STEP_S), 1),
        (linear_pieces(white(81), STEP_S / 4), 4),
        (held_pieces(white(80)), 4),
        (held_pieces(white(80)), 1),
    ],
    ids=["cubic", "linear, upsampled", "held, upsampled", "held"],
)
def test_the_response_to_a_piecewise_polynomial_is_exact(pieces: Array, upsampling: int) -> None:
    n = len(pieces) // upsampling
    found = Prefilter(D, STEP_S).respond(pieces, 0, n, upsampling)
    reference = exact(pieces, STEP_S / upsampling)[::upsampling]
    size = np.abs(reference).max(axis=0)
    np.testing.assert_allclose(found / size, reference / size, rtol=0, atol=1e-9)


def test_a_sine_through_the_filter_has_the_gain_and_phase_of_the_formula() -> None:
    time = STEP_S * np.arange(20_001)
    w = 2 * np.pi * 29.0
    heavy = Denominator(0.02, 0.9, 677.3)  # rings out within the first second
    pieces = smooth_pieces(np.sin(w * time), STEP_S)
    found = Prefilter(heavy, STEP_S).respond(pieces, 0, 20_000)[10_000:, 1]
    answer = 1j * w / (677.3 - 0.02 * w * w + 0.9j * w)
    np.testing.assert_allclose(found, (answer * np.exp(1j * w * time[10_000:])).imag, atol=2e-5 * abs(answer))


def test_a_response_begun_later_starts_from_rest_there() -> None:
    pieces = smooth_pieces(white(200), STEP_S)
    pre = Prefilter(D, STEP_S)
    np.testing.assert_allclose(pre.respond(pieces, 50, 150), pre.respond(pieces[50:150], 0, 100))


def test_the_free_motions_are_those_of_the_platform_released_from_one_and_from_rate_one() -> None:
    a = np.array([[0.0, 1.0], [-D.stiffness / D.inertia, -D.damping / D.inertia]])
    free = Prefilter(D, STEP_S).free(500)
    for k in (0, 1, 77, 499):
        np.testing.assert_allclose(free[k], expm(a * k * STEP_S)[0], atol=1e-12)


@pytest.mark.parametrize("rho", [0.0, 0.3, 20.0, 5000.0])
@pytest.mark.parametrize("rate_measured", [True, False])
def test_the_denominator_is_the_spectral_factor_of_sensor_noise_and_torque_disturbance(
    rho: float, rate_measured: bool
) -> None:
    j, c, k = 0.02, 0.045, 677.3
    d = Denominator.of(j, c, k, rho, rate_measured)
    w = np.geomspace(0.1, 2000.0, 50)
    disturbance = (rho * w) ** 2 if rate_measured else np.full_like(w, rho**2)
    wanted = (k - j * w * w) ** 2 + (c * w) ** 2 + disturbance
    np.testing.assert_allclose((d.stiffness - d.inertia * w * w) ** 2 + (d.damping * w) ** 2, wanted, rtol=1e-9)


@pytest.mark.parametrize("jck", [(0.02, -0.3, 677.3), (0.02, 0.045, -50.0), (1e-30, 0.0, 0.0), (0.02, 0.0, 677.3)])
def test_the_filter_stays_bounded_whatever_the_estimate(jck: tuple[float, float, float]) -> None:
    d = Denominator.of(*jck, rho=1.0, rate_measured=True)
    phi, _ = d.transition(STEP_S)
    assert np.all(np.abs(np.linalg.eigvals(phi)) <= 1.0 + 1e-12)
