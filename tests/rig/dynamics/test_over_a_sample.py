"""The transition and the covariance over a sample, beside closed forms and a library's exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from rig.arrays import Array
from rig.dynamics.over_a_sample import over_a_sample


def found(f: Array, density: Array, step_s: float) -> tuple[Array, Array]:
    phi, q = np.empty_like(f), np.empty_like(f)
    over_a_sample(f.copy(), density.copy(), step_s, phi, q)
    return phi, q


@pytest.mark.parametrize("step_s", [1e-5, 1e-3, 0.02])
def test_it_is_the_block_exponential_of_van_loan(step_s: float) -> None:
    rng = np.random.default_rng(3)
    f, root = rng.normal(size=(6, 6)) * 30.0, rng.normal(size=(6, 6))
    density = root @ root.T
    phi, q = found(f, density, step_s)
    block = expm(np.block([[-f, density], [np.zeros((6, 6)), f.T]]) * step_s)
    np.testing.assert_allclose(phi, expm(f * step_s), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(q, block[6:, 6:].T @ block[:6, 6:], rtol=1e-9, atol=1e-10 * np.max(q))
    np.testing.assert_array_equal(q, q.T)


@pytest.mark.parametrize("lag_s", [1e-7, 1e-5, 1e-3, 10.0])
def test_a_lag_of_any_length_has_the_covariance_of_its_closed_form(lag_s: float) -> None:
    step_s, white = 0.02, 3.0
    phi, q = found(np.array([[-1.0 / lag_s]]), np.array([[white]]), step_s)
    assert phi[0, 0] == pytest.approx(np.exp(-step_s / lag_s), rel=1e-9, abs=1e-300)
    assert q[0, 0] == pytest.approx(-0.5 * white * lag_s * np.expm1(-2.0 * step_s / lag_s), rel=1e-9)


def test_units_that_lie_far_apart_cost_no_digits() -> None:
    """A second-order low-pass of 1e-7 s, whose slope is counted in rad/s^2, beside the rate that it follows."""
    first, second, step_s = 1.4e-7, 1e-14, 0.02
    f = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0 / second, -1.0 / second, -first / second]])
    phi, q = found(f, np.diag([2.0, 0.0, 0.0]), step_s)
    np.testing.assert_allclose(phi[:2], [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(phi[2] * np.sqrt(second), 0.0, atol=1e-12)  # a slope, of a rate a time constant
    assert q[0, 0] == pytest.approx(2.0 * step_s, rel=1e-12)
    assert q[1, 0] == pytest.approx(2.0 * (step_s - first), rel=1e-9)  # what comes out lags by the first coefficient
