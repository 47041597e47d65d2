"""What every kind of fit holds: standard errors, and one scale on which each of them is at the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import best_rho, first_guess, scale_of
from identify.estimate.output_error import OutputErrorFit, refine
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameter_fit import ParameterFit, reduced_chi_square
from identify.model.parameters import Name, names_of
from identify.model.structure import Structure
from identify.rivals.whole_runs import FreeRunFitter
from identify.runs.holdout import split
from identify.signals.trace import pooled_noise
from rig.platform import TERMS
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, traces_of

JCK: dict[Name, float] = {(t,): v for t, v in zip(TERMS, TRUTH, strict=True)}
TWO_SETS = ((104.0, 3.0), (42.0, 9.0))


def fit_with(information: float = 1.0, effects: tuple[str, ...] = (), *values: float) -> ParameterFit:
    structure = Structure(effects=effects)
    names = names_of(structure, 1)
    return ParameterFit(structure, names, np.array(values), 1000, 1.0, 1000.0, information * np.eye(len(names)))


def test_a_limit_that_nothing_reaches_has_no_standard_error() -> None:
    seen = fit_with(1.0, ("torque_saturation",), 0.01, 0.05, 500.0, 90.0)
    information = seen.information.copy()
    information[3, 3] = 0.0
    unreached = replace(seen, information=information)
    assert unreached.std_errors()[("torque_saturation", "limit")] == np.inf
    assert unreached.std_errors()[("stiffness",)] == unreached.std_error(("stiffness",)) == pytest.approx(1.0)


def test_an_effect_of_a_model_that_runs_away_stands_nowhere() -> None:
    found = fit_with(16.0, ("coulomb_friction",), 1, 1, 1, 3)
    across = found.information.copy()
    across[0, 1] = across[1, 0] = np.inf
    assert all(np.isinf(e) for e in replace(found, information=across).std_errors().values())


def test_every_parameter_is_paid_for() -> None:
    few, more = fit_with(1.0, (), 1, 1, 1), fit_with(1.0, ("coulomb_friction",), 1, 1, 1, 0)
    assert more.penalised - few.penalised == pytest.approx(np.log(1000.0))


def test_the_held_out_error_is_a_geometric_mean_so_that_one_lost_run_does_not_decide() -> None:
    def held_out(squares: Sequence[float]) -> float:
        fit = OutputErrorFit.unfitted(Structure(), names_of(Structure(), 1), np.ones(3))
        counts = np.full(len(squares), 100.0)
        return replace(fit, held_out_squares=np.array(squares), held_out_counts=counts).held_out_error

    assert held_out([100.0] * 20) == pytest.approx(1.0)
    assert held_out([100.0] * 19 + [1e6]) < 1.3


def test_whatever_fits_a_linear_platform_at_the_noise_says_so_on_one_scale_and_with_the_same_standard_errors() -> None:
    traces = traces_of(campaign(sets=TWO_SETS, duration_s=2.0))
    start, noise = first_guess(traces, Structure()), pooled_noise(traces)
    simulated = refine(traces, Structure(), JCK)
    predicted = PredictionError(traces).fit(Structure(), JCK)
    regressed = best_rho(traces, Structure(), {}, replace(start, rho=0.0))
    whole = FreeRunFitter(traces, split(traces)).fitted(Structure(), JCK)
    assert whole is not None
    chi_square = (
        simulated.reduced_chi_square, predicted.reduced_chi_square, whole.reduced_chi_square,
        reduced_chi_square(regressed.sigma, noise), reduced_chi_square(whole.held_out_error, noise),
    )  # fmt: skip
    np.testing.assert_allclose(chi_square, 1.0, atol=0.1)
    for name in JCK:
        errors = [fit.std_error(name) for fit in (predicted, regressed)]
        np.testing.assert_allclose(errors, simulated.std_error(name), rtol=0.1)


def test_the_information_of_a_fit_in_torque_is_the_curvature_of_its_squares() -> None:
    traces = traces_of(campaign({"coulomb_friction": {"level": 1.0}}, noise=10.0 * NOISE_RAD_S))
    regression = TorqueRegression(traces, split(traces), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(effects=("coulomb_friction",)), {})
    for i, name in enumerate(fit.names):
        moves = 0.1 * abs(fit.values[name])
        low, at, high = (
            regression.left_by(fit.structure, {**fit.values, name: fit.values[name] + by}) ** 2
            for by in (-moves, 0.0, moves)
        )
        curvature = (low + high - 2.0 * at) / (2.0 * moves**2) * fit.count
        assert fit.information[i, i] == pytest.approx(curvature, rel=1e-9), name
