"""The white-residual regression reaches the sensor's own noise and the Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.initial_guess import best_rho, first_guess
from identify.estimate.regression import Regression, RegressionFit, fit, normal, residuals, solve
from identify.model.structure import Structure
from identify.signals.prefilter import Denominator
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, decay_run, sine_run, traces_of
from tests.rig.effects.values import VALUES


def solved(traces: list[Trace], effects: tuple[str, ...] = (), **shapes: tuple[float, ...]) -> RegressionFit:
    start = first_guess(traces, Structure()).platform
    return fit(Regression(traces, Structure(effects=effects)), shapes, start, 0.0, 8)


def bound_of(solution: RegressionFit) -> np.ndarray:
    """Cramer-Rao bound of the parameters for the gyro's noise, shape (p,)."""
    scale = np.sqrt(np.diag(solution.information))
    inverse = np.linalg.inv(solution.information / np.outer(scale, scale))
    return np.sqrt(np.diag(inverse)) / scale * NOISE_RAD_S


@pytest.mark.parametrize("seed", range(3))
def test_on_the_papers_sets_the_residual_is_the_gyros_noise_and_jck_lie_within_the_bound(seed: int) -> None:
    solution = solved(traces_of(campaign(seed=seed, bias=3e-4)))
    assert solution.sigma == pytest.approx(NOISE_RAD_S, rel=0.02)
    bound = bound_of(solution)
    np.testing.assert_allclose(bound / TRUTH, [3.1e-6, 1.9e-5, 3.1e-6], rtol=0.1)
    assert np.all(np.abs(solution.vector - TRUTH) < 4.0 * bound)


def test_over_many_noises_the_estimates_scatter_as_the_bound_says_and_about_the_truth() -> None:
    run = sine_run(42, 9, duration_s=2, noise=0.0)
    assert run.rate_rad_s is not None
    found = []
    for seed in range(40):
        noise = NOISE_RAD_S * np.random.default_rng(seed).standard_normal(len(run.time_s))
        solution = solved(traces_of(Recording((replace(run, rate_rad_s=run.rate_rad_s + noise),))))
        found.append((solution.vector - TRUTH) / bound_of(solution))
    assert np.all(np.abs(np.mean(found, axis=0)) < 4.0 / np.sqrt(40))
    np.testing.assert_allclose(np.std(found, axis=0), 1.0, atol=0.45)


def test_the_residual_is_white() -> None:
    traces = traces_of(campaign())
    solution = solved(traces)
    blocks = Regression(traces, Structure()).blocks(solution.denominator, {})
    for r in residuals(blocks, solution.vector):
        lagged = [float(r[k:] @ r[:-k]) / float(r @ r) for k in range(1, 20)]
        assert np.max(np.abs(lagged)) < 4.5 / np.sqrt(len(r))


def test_starts_a_hundred_times_apart_end_at_the_same_numbers() -> None:
    regression = Regression(traces_of(campaign()), Structure())
    low, high = (fit(regression, {}, tuple(f * x for x in TRUTH), 0.0, 8) for f in (0.1, 10.0))  # type: ignore[arg-type]
    np.testing.assert_allclose(low.vector, high.vector, rtol=1e-7)


@pytest.mark.parametrize("name", ["cubic_stiffness", "quadratic_damping", "stiffness_drift", "bilinear_stiffness"])
def test_an_effect_that_is_linear_in_its_gain_is_solved_with_the_rest(name: str) -> None:
    solution = solved(traces_of(campaign({name: VALUES[name]})), (name,))
    ((parameter, value),) = VALUES[name].items()
    assert solution.values[(name, parameter)] == pytest.approx(value, rel=0.02)
    assert solution.values[("damping",)] == pytest.approx(TRUTH[1], rel=0.04)
    assert solution.values[("stiffness",)] == pytest.approx(TRUTH[2], rel=2e-4)


def test_at_the_true_delay_nothing_but_noise_is_left() -> None:
    traces = traces_of(campaign({"torque_delay": {"delay": 1.5e-3}}))
    without, with_it = solved(traces), solved(traces, ("torque_delay",), torque_delay=(1.5e-3,))
    assert without.sigma > 100 * NOISE_RAD_S
    assert with_it.sigma == pytest.approx(NOISE_RAD_S, rel=0.02)
    assert with_it.values[("damping",)] == pytest.approx(TRUTH[1], rel=2e-4)


def test_lost_samples_and_jitter_cost_a_little_accuracy_and_no_bias() -> None:
    rng = np.random.default_rng(5)
    runs = []
    for torque, frequency in ((104.0, 3.0), (42.0, 9.0)):
        time = np.arange(4001) * 1e-3
        seen = time + rng.uniform(-5e-5, 5e-5, len(time))
        signal = TorqueSignal(time, torque * np.sin(2 * np.pi * frequency * time))
        rate = simulate(Platform(*TRUTH), np.clip(seen, 0, 4), signal, substeps=16).rate_rad_s
        rate = rate + NOISE_RAD_S * rng.standard_normal(len(time))
        kept = np.sort(rng.choice(len(time), 3900, replace=False))
        ok = np.ones(len(kept), bool)
        runs.append(
            Run(f"{frequency}", seen[kept], ok, rate_rad_s=rate[kept], torque_time_s=time, torque_nm=signal.torque_nm)
        )
    solution = solved(traces_of(Recording(tuple(runs))))
    assert solution.sigma < 1.3 * NOISE_RAD_S
    np.testing.assert_allclose(solution.vector, TRUTH, rtol=1e-3)


def test_a_free_decay_gives_damping_and_stiffness_per_inertia() -> None:
    platform = Platform(0.5, 0.1, 20.0)
    traces = traces_of(Recording((decay_run(platform),)))
    regression = Regression(traces, Structure())
    assert regression.torque_free
    assert regression.labels == (("damping",), ("stiffness",))
    solution = best_rho(traces, Structure(), {}, first_guess(traces, Structure()))
    assert solution.values[("damping",)] == pytest.approx(0.2, rel=5e-3)
    assert solution.values[("stiffness",)] == pytest.approx(40.0, rel=1e-4)


def test_a_known_inertia_that_was_mounted_does_not_count_as_the_platforms() -> None:
    plain = sine_run(104, 3)
    heavy = replace(sine_run(104, 3, jck=(0.024, *TRUTH[1:]), seed=1), added_inertia_kg_m2=0.004)
    solution = solved(traces_of(Recording((plain, heavy))))
    np.testing.assert_allclose(solution.vector, TRUTH, rtol=2e-4)


def test_one_steady_tone_leaves_a_direction_that_nothing_determines_and_its_ring_fills_it() -> None:
    trace = traces_of(Recording((sine_run(104, 3, duration_s=14, noise=0.0),)))[0]

    def weakest(piece: Trace) -> float:
        a = normal(Regression([piece], Structure()).blocks(Denominator(*TRUTH), {})).a
        scale = np.sqrt(np.diag(a))
        return float(np.linalg.eigvalsh(a / np.outer(scale, scale))[0])

    assert weakest(trace.piece(0, 2000)) > 1e-3
    assert weakest(trace.piece(12_000, 14_000)) < 1e-5, "by then the ring has died out"


def test_a_column_without_information_is_left_at_zero() -> None:
    a = np.array([[4.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(solve(a, np.array([2.0, 0.0])), [0.5, 0.0])


def test_a_noisy_torque_is_met_by_a_filter_that_weighs_torque() -> None:
    rng = np.random.default_rng(3)
    run = sine_run(104, 3)
    assert run.torque_nm is not None
    shaken = replace(run, torque_nm=run.torque_nm + 2.0 * rng.standard_normal(len(run.torque_nm)))
    traces = traces_of(Recording((shaken,)))
    start = first_guess(traces, Structure())
    assert best_rho(traces, Structure(), {}, start).rho > 0.0
    assert best_rho(traces_of(Recording((run,))), Structure(), {}, start).rho == 0.0
