"""Steps within bounds, and fits that arrive although a number of the noise stands at one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from identify.likelihood.derivatives import Derivatives
from identify.likelihood.fit import Columns
from identify.likelihood.normal_equations import COST_TOLERANCE, Floor, bounded_step, normal_equations
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise
from rig.platform import TERMS
from tests.identify.simulated import SETS, TRUTH, campaign, traces_of


def test_without_bounds_in_its_way_a_step_is_that_of_the_normal_equations() -> None:
    matrix, right = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, -1.0])
    far = np.array([10.0, 10.0])
    assert bounded_step(matrix, right, -far, far) == pytest.approx(np.linalg.solve(matrix, right))


def test_beside_a_number_that_is_held_the_others_are_solved_for_again() -> None:
    # The second hardly acts and would be sent to -100; the first counted on that.
    columns = np.array([[1.0, 0.5], [0.0, 0.01], [0.0, 0.0]])
    residual = np.array([1.0, -1.0, 0.0])
    matrix, right = columns.T @ columns, columns.T @ residual
    low, high = np.array([-1e3, -4.0]), np.array([1e3, 4.0])
    best = lsq_linear(columns, residual, (low, high), tol=1e-12).x
    assert bounded_step(matrix, right, low, high) == pytest.approx(best, rel=1e-6)
    assert bounded_step(matrix, right, low, high) == pytest.approx([3.0, -4.0])
    assert np.linalg.solve(matrix, right)[0] == pytest.approx(51.0)


@pytest.mark.parametrize("seed", range(8))
def test_of_two_numbers_that_do_nearly_the_same_neither_is_held_where_the_other_sent_it(seed: int) -> None:
    """As the size of a disturbance and its time constant: a step cut off there would lead upwards."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((40, 1)) * np.array([1.0, 1.0, -1.0, 1.0, 1.0])
    columns += 0.05 * rng.standard_normal((40, 5))
    residual = rng.standard_normal(40)
    low, high = np.array([-0.1, -4.0, -1.6, 0.0, -3.0]), np.array([4.0, 4.0, 18.0, 4.0, 0.2])
    step = bounded_step(columns.T @ columns, columns.T @ residual, low, high)
    best = lsq_linear(columns, residual, (low, high), tol=1e-12)
    assert np.all((step >= low) & (step <= high))
    assert np.sum((columns @ step - residual) ** 2) == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert np.sum((columns @ step - residual) ** 2) <= np.sum(residual**2)


def test_where_nothing_may_move_no_step_is_taken() -> None:
    nothing = np.zeros(2)
    assert np.array_equal(bounded_step(np.eye(2), np.ones(2), nothing, nothing), nothing)


def test_where_a_model_runs_away_and_nothing_is_left_to_predict_no_step_is_promised() -> None:
    nothing = np.zeros((6, 2))
    columns = Columns(nothing, np.ones((6, 1)), np.zeros(6), np.full(6, np.inf))
    found = normal_equations([Derivatives(columns, nothing, nothing)], 2, 0, 6, Floor(1.0, np.zeros(2)))
    assert found.promised == 0.0
    assert np.array_equal(bounded_step(found.matrix, found.right, -np.ones(2), np.ones(2)), np.zeros(2))


def test_a_fit_arrives_where_a_fit_from_the_truth_does_though_nothing_disturbs() -> None:
    """Beside a right model the disturbance has no size: its numbers stand at their bounds and hardly act."""
    problem = PredictionError(one_noise(traces_of(campaign(sets=SETS[2:], duration_s=1.0)), False))
    true = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    begun = {k: 1.3 * v for k, v in true.items()}
    assert problem.fit(Structure(), begun).cost < problem.fit(Structure(), true).cost + 4.0 * COST_TOLERANCE
