"""Evidence is worth less where the likelihood is wrong: where scores scatter by more than it takes them to."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.likelihood.fit import Columns
from identify.select.evidence import Evidence, inflation
from rig.arrays import Array

N = 2000


def parts(residuals: list[Array], columns: list[Array]) -> tuple[list[Columns], SimpleNamespace]:
    """Runs with two parameters, and the fit that they belong to."""
    runs = [
        Columns(x, np.zeros((len(z), 0)), z, np.ones(len(z))) for x, z in zip(columns, residuals, strict=True)
    ]  # fmt: skip
    variance = float(np.mean(np.concatenate(residuals) ** 2))
    return runs, SimpleNamespace(names=(("inertia",), ("coulomb_friction", "level")), variance=variance)


def slow(seed: int, runs: int = 2) -> list[Array]:
    """Columns that change slowly, (n, 2) each."""
    rng = np.random.default_rng(seed)
    return [np.asarray(lfilter([1.0], [1.0, -0.95], rng.standard_normal((N, 2)), axis=0)) for _ in range(runs)]


def white(seed: int, runs: int = 2) -> list[Array]:
    rng = np.random.default_rng(seed)
    return [rng.standard_normal(N) for _ in range(runs)]


NAME = [("coulomb_friction", "level")]


def test_where_the_residual_is_white_a_likelihood_is_worth_what_it_says() -> None:
    found = [inflation(*parts(white(seed), slow(100 + seed)), NAME) for seed in range(40)]  # type: ignore[arg-type]
    assert np.median(found) == 1.0
    assert np.mean(np.array(found) > 1.5) < 0.05


def test_where_the_residual_is_slow_too_it_is_worth_a_fraction() -> None:
    coloured = [np.asarray(lfilter([1.0], [1.0, -0.9], z)) for z in white(1)]
    assert inflation(*parts(coloured, slow(2)), NAME) > 4.0  # type: ignore[arg-type]


def test_what_differs_between_runs_counts_though_it_is_the_same_all_along_each() -> None:
    rng = np.random.default_rng(3)
    columns = slow(4, runs=12)
    apart = [z + 0.3 * s * x[:, 1] for z, x, s in zip(white(5, 12), columns, rng.choice([-1.0, 1.0], 12), strict=True)]
    assert inflation(*parts(apart, columns), NAME) > 10.0  # type: ignore[arg-type]


def test_support_is_what_is_left_of_the_gain_when_parameters_are_paid_for() -> None:
    fit = SimpleNamespace(penalised=0.0)
    found = Evidence("coulomb_friction", fit, 400.0, 8.0, 9.0, 0.9)  # type: ignore[arg-type]
    assert found.support == pytest.approx(41.0)
