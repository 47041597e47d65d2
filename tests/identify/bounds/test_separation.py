"""By how much one of two models is believed to be likelier: blocks tell unlike much, and none decides alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.bounds.separation import agreement, block_divergences, support_difference
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from rig.arrays import Array
from rig.platform import TERMS
from tests.identify.simulated import sine_run

SOFT = (0.1, 0.5, 40.0)


def falls_of(apart: Array, seed: int, over: float = 1.0) -> Array:
    """What blocks' costs fall by where the other model is right, and scatter ``over`` times more than by noise."""
    return apart + 2.0 * over * np.sqrt(apart) * np.random.default_rng(seed).standard_normal(len(apart))


def test_few_blocks_may_tell_all() -> None:
    """One run in five at a large amplitude: ranks of thirty blocks never parted a spring that stiffens from a step."""
    apart = np.full(30, 0.2)
    apart[:6] = 40.0
    assert min(agreement(falls_of(apart, seed), apart) ** 2 for seed in range(20)) > 10.0


def test_the_scatter_by_noise_alone_is_known() -> None:
    """Two models apart by M are parted by M / 4 in squares of standard errors, however blocks happen to lie."""
    apart = np.full(30, 4.0)
    found = [agreement(falls_of(apart, seed), apart) for seed in range(200)]
    assert np.mean(found) == pytest.approx(np.sqrt(30.0), abs=0.6)  # two blocks are left out, the scatter is estimated
    assert agreement(apart, apart) ** 2 == pytest.approx(28.0)  # no better than that, though all agree exactly


def test_what_scatters_more_is_believed_less() -> None:
    apart = np.full(30, 4.0)
    by_noise, coloured = (
        np.mean([agreement(falls_of(apart, seed, over), apart) for seed in range(100)]) for over in (1.0, 3.0)
    )
    assert coloured < 0.5 * by_noise


def test_blocks_that_differ_alike_agree_wherever_the_predictions_lie_apart() -> None:
    """A creep that was left out, the disturbance larger for it: 20 in every block, and the starts lie far apart."""
    apart = np.full(30, 5.0)
    apart[[0, 10, 20]] = 200.0
    falls = 20.0 + 4.0 * np.random.default_rng(3).standard_normal(30)
    assert agreement(falls, apart) ** 2 > 50.0


def test_two_models_that_are_as_wrong_are_parted_by_chance_only() -> None:
    """Blocks that agree with neither: thirty of them by 10 (3.2 standard errors) less than once in a hundred."""
    rng = np.random.default_rng(1)
    apart = rng.uniform(0.5, 20.0, 30)
    found = [agreement(2.0 * np.sqrt(apart) * rng.standard_normal(30), apart) ** 2 for _ in range(1000)]
    assert np.mean(np.array(found) > 10.0) < 0.01


def test_no_single_block_decides() -> None:
    """In which one of the models happens to fail."""
    apart = np.full(30, 0.5)
    apart[7] = 400.0
    falls = np.full(30, -0.5)
    falls[7] = 400.0
    assert agreement(falls, apart) == 0.0


def test_no_single_block_stands_against_all_others() -> None:
    """A start that one model misses took 5,300 of the cost back, of 14,500 by which it led in all other blocks."""
    apart = np.full(30, 500.0)
    falls = np.full(30, 500.0)
    falls[0] = -5300.0
    assert agreement(falls, apart) ** 2 > 100.0


def test_models_that_predict_alike_differ_by_their_price() -> None:
    nothing = np.zeros(30)
    assert agreement(nothing, nothing) == 0.0
    assert agreement(nothing, nothing + 1e-6, price=18.0) ** 2 > 18.0


@pytest.fixture(scope="module")
def fits() -> dict[str, Fit]:
    """Of five runs, the last of which alone swings far; the platform's spring stiffens."""
    truth = {"cubic_stiffness": {"factor": 40.0}}
    runs = [
        sine_run(a, 1.0 + 0.3 * k, effects=truth, jck=SOFT, seed=k, duration_s=4.0)
        for k, a in enumerate((1, 1, 1, 1, 12))
    ]
    problem = PredictionError(one_noise([prepare(run, i) for i, run in enumerate(runs)], False))
    start = {(k,): v for k, v in zip(TERMS, SOFT, strict=True)}
    names = ("", "cubic_stiffness", "quadratic_stiffness")
    return {n: problem.fit(Structure().plus(n) if n else Structure(), start, thorough=False) for n in names}


def test_predictions_lie_apart_where_the_models_differ(fits: dict[str, Fit]) -> None:
    apart = block_divergences(fits[""], fits["cubic_stiffness"])
    assert apart.shape == (30,)
    assert np.all(apart > 0.0)
    assert block_divergences(fits["cubic_stiffness"], fits[""]) == pytest.approx(apart, rel=1e-9)
    assert np.all(block_divergences(fits[""], fits[""]) < 1e-12)


def test_one_run_that_shows_it_is_enough(fits: dict[str, Fit]) -> None:
    assert support_difference(fits["quadratic_stiffness"], fits["cubic_stiffness"]) > 10.0
    assert support_difference(fits["cubic_stiffness"], fits["quadratic_stiffness"]) == 0.0


def test_a_model_that_runs_away_is_behind_any_other(fits: dict[str, Fit]) -> None:
    astray = replace(fits["cubic_stiffness"], cost=np.inf)
    assert support_difference(astray, fits[""]) == np.inf
    assert support_difference(fits[""], astray) == 0.0


def lagging(lag: str, innovations: Array) -> Any:
    """A fit with a lag, as far as a comparison looks at it: one run of unit variance, its cost that of white noise."""
    count, size = len(innovations), float(np.mean(innovations**2))
    shots = SimpleNamespace(
        weight=np.ones(count, dtype=bool), edges=[(0, count)], trace=SimpleNamespace(torque=np.zeros(1))
    )
    costs = innovations**2 / size + np.log(size) - 1.0
    seen = SimpleNamespace(innovations=[innovations[:, None]], variance=[np.ones((count, 1))], costs=[costs])
    return SimpleNamespace(
        structure=Structure(effects=(lag,)), prediction=seen, shots=(shots,), variance=size,
        cost=float(np.sum(costs)), penalised=float(np.sum(costs)),
    )  # fmt: skip


def test_a_lag_that_only_fits_the_colour_of_the_noise_better_is_no_likelier() -> None:
    """Noise with a colour that no model has: a low-pass of the wrong form whitened some of it, and J was 0.07 % off."""
    white = np.random.default_rng(1).standard_normal(20_000)
    coloured = np.asarray(lfilter([1.0, 0.3], [1.0], white))
    nearer = np.asarray(lfilter([1.0, 0.2], [1.0], white))
    wrong, right = lagging("sensor_lag", nearer), lagging("sensor_lag_second_order", coloured)
    assert right.cost - wrong.cost > 500.0
    assert support_difference(right, wrong) < 1.0
    same = lagging("sensor_lag", coloured)  # two other effects are compared as they stand
    assert support_difference(same, wrong) > 100.0


def test_a_lag_that_predicts_the_motion_better_is_likelier_whatever_the_noise() -> None:
    rng = np.random.default_rng(2)
    coloured = np.asarray(lfilter([1.0, 0.3], [1.0], rng.standard_normal(20_000)))
    right, late = lagging("sensor_lag", coloured), lagging("torque_delay", coloured + 0.2 * rng.standard_normal(20_000))
    assert support_difference(late, right) > 50.0
