"""Compiled evaluation against SciPy's own, which is the reference here."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from rig.dynamics.polynomials import Polynomials

RNG = np.random.default_rng(5)
KNOTS = np.cumsum(RNG.uniform(0.5e-3, 1.5e-3, 400))
VALUES = RNG.normal(size=400)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_b_spline_is_read_as_scipy_reads_it(degree: int) -> None:
    spline = make_interp_spline(KNOTS, VALUES, k=degree)
    at = np.linspace(KNOTS[0], KNOTS[-1], 10_001)
    np.testing.assert_allclose(Polynomials(spline)(at), spline(at), rtol=0.0, atol=1e-11)
    for other in (spline.derivative(), spline.antiderivative()):  # of the one, SciPy holds weights that are not used
        np.testing.assert_allclose(Polynomials(other)(at[:-1]), other(at[:-1]), rtol=1e-11, atol=1e-11)


def test_a_cubic_spline_and_its_integral_are_read_as_scipy_reads_them() -> None:
    spline = CubicSpline(KNOTS, VALUES)
    at = np.linspace(KNOTS[0] - 1e-3, KNOTS[-1] + 1e-3, 5_000)  # beyond the ends the outer polynomials go on
    for each in (spline, spline.antiderivative(), spline.derivative()):
        np.testing.assert_allclose(Polynomials(each)(at), each(at), rtol=1e-11, atol=1e-11)


def test_order_and_shape_of_the_instants_do_not_matter() -> None:
    read = Polynomials(make_interp_spline(KNOTS, VALUES, k=5))
    at = RNG.permutation(np.concatenate([KNOTS, 0.5 * (KNOTS[1:] + KNOTS[:-1])]))[:796]
    in_order = np.sort(at)
    np.testing.assert_array_equal(read(at), read(in_order)[np.searchsorted(in_order, at)])
    np.testing.assert_array_equal(read(at.reshape(2, 398)).ravel(), read(at))
    assert read(np.array(KNOTS[7])).shape == ()
    assert float(read(np.array(KNOTS[7]))) == pytest.approx(VALUES[7])


def test_a_single_piece_and_an_instant_that_is_no_number() -> None:
    line = Polynomials(make_interp_spline(np.array([0.0, 2.0]), np.array([1.0, 5.0]), k=1))
    found = line(np.array([1.0, np.nan, 2.0]))
    assert found[0] == pytest.approx(3.0)
    assert np.isnan(found[1])
    assert found[2] == pytest.approx(5.0)
