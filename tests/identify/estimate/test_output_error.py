"""Output error: the simulated model against what the gyro measured, in shots and in free run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from identify.estimate.evaluation import evaluate
from identify.estimate.output_error import refine
from identify.model.parameters import bounds_of, names_of, ordered
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.simulate.shots import make_shots
from rig.recording.run import Recording
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, sine_run, traces_of

JCK = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
TWO_SETS = ((104.0, 3.0), (42.0, 9.0))


def start(factor: float = 1.0, **effects: Mapping[str, float]) -> dict[tuple[str, ...], float]:
    out: dict[tuple[str, ...], float] = {n: factor * v for n, v in JCK.items()}
    for name, given in effects.items():
        out |= {(name, p): v for p, v in given.items()}
    return out


def test_a_delay_and_coulomb_friction_are_found_from_a_start_that_is_well_off() -> None:
    hidden = {"torque_delay": {"delay": 1.5e-3}, "coulomb_friction": {"level": 1.2}}
    traces = traces_of(campaign(hidden, sets=TWO_SETS, duration_s=2.0))
    structure = Structure(effects=("coulomb_friction", "torque_delay"))
    guess = start(1.05, coulomb_friction={"level": 0.6}, torque_delay={"delay": 1e-3})
    near = refine(traces, structure, guess, 0.02, 10)
    near = refine(traces, structure, near.values, 0.1, 10)
    found = refine(traces, structure, near.values, None, 10)
    assert found.sigma == pytest.approx(NOISE_RAD_S, rel=0.03)
    assert found.values["torque_delay", "delay"] == pytest.approx(1.5e-3, rel=1e-3)
    assert found.values["coulomb_friction", "level"] == pytest.approx(1.2, rel=2e-3)
    assert found.values["damping",] == pytest.approx(TRUTH[1], rel=5e-3)
    np.testing.assert_allclose([found.values["inertia",], found.values["stiffness",]], [TRUTH[0], TRUTH[2]], rtol=1e-4)


def test_runs_that_begin_stuck_beside_the_springs_rest_tell_friction_and_the_gyros_lag_to_the_noise() -> None:
    hidden = {"coulomb_friction": {"level": 1.0}, "sensor_lag": {"time": 1e-3}}
    stuck = 0.8 / TRUTH[2]  # as far as friction may hold it
    runs = [sine_run(m, f, effects=hidden, duration_s=3.0, begin_rad=b) for (m, f), b in
            zip(((104.0, 3.0), (42.0, 9.0)), (stuck, -stuck), strict=True)]  # fmt: skip
    traces = traces_of(Recording(tuple(runs)))
    structure = Structure(effects=("coulomb_friction", "sensor_lag"))
    guess = start(coulomb_friction={"level": 0.97}, sensor_lag={"time": 0.95e-3})
    found = refine(traces, structure, guess, None, 15)
    assert found.sigma == pytest.approx(NOISE_RAD_S, rel=0.03)
    assert found.values["sensor_lag", "time"] == pytest.approx(1e-3, rel=1e-3)
    assert found.values["coulomb_friction", "level"] == pytest.approx(1.0, rel=1e-3)
    np.testing.assert_allclose([s.starts[0, 0] for s in found.shots], [stuck, -stuck], rtol=0.02)


def test_ten_seconds_of_stribeck_friction_are_repeated_to_the_noise_at_the_true_parameters() -> None:
    friction = {"coulomb": 1.2, "static": 2.4, "speed": 0.08}
    run = sine_run(42, 9, effects={"stribeck_friction": friction}, duration_s=10)
    traces = [prepare(run)]
    structure = Structure(effects=("stribeck_friction",))
    found = refine(traces, structure, start(stribeck_friction=friction), None, 4)
    assert found.sigma == pytest.approx(NOISE_RAD_S, rel=0.03)


def test_short_shots_hold_a_wrong_model_near_the_data_where_a_free_run_is_lost() -> None:
    traces = [prepare(sine_run(42, 9))]
    stiff = start() | {("stiffness",): 1.1 * TRUTH[2]}
    wrong = refine(traces, Structure(), stiff, None, 0)
    held = refine(traces, Structure(), stiff, 0.01, 0)
    assert held.sigma < 0.6 * wrong.sigma


def test_every_shot_begins_at_the_smoothed_measured_state() -> None:
    trace = prepare(sine_run(104, 3))
    shots = make_shots(trace, 4, 100)
    assert shots.edges[:2] == [(0, 10), (10, 110)]  # the lead-in carries no weight and is a shot of its own
    assert shots.edges[-1][1] == len(trace.measured)
    angle, rate, _, _, _ = trace.fine
    np.testing.assert_allclose(shots.starts, np.stack([angle, rate], axis=1)[shots.first * 4])


def test_a_gyros_bias_is_fitted_and_disturbs_nothing() -> None:
    traces = traces_of(campaign(sets=TWO_SETS, bias=5e-3))
    found = refine(traces, Structure(), start(1.01), None, 8)
    assert found.shots[0].bias == pytest.approx(5e-3, rel=0.02)
    np.testing.assert_allclose(found.vector, TRUTH, rtol=3e-4)


def test_one_bad_shot_among_many_does_not_move_the_estimate() -> None:
    trace = prepare(sine_run(104, 3))
    good = refine([trace], Structure(), start(), 0.1, 6)
    struck = prepare(sine_run(104, 3))
    struck.measured = struck.measured.copy()
    struck.measured[2020:2040] += 3.0
    robust = refine([struck], Structure(), start(), 0.1, 10)
    np.testing.assert_allclose(robust.vector[[0, 2]], good.vector[[0, 2]], rtol=2e-3)


def test_judging_fits_start_states_and_nothing_else() -> None:
    fitted = refine([prepare(sine_run(104, 3))], Structure(), start(), None, 5)
    held = evaluate(fitted, [prepare(sine_run(42, 9, seed=4))])
    np.testing.assert_array_equal(held.vector, fitted.vector)
    assert held.sigma == pytest.approx(NOISE_RAD_S, rel=0.05)


def test_the_information_is_that_of_the_gyros_noise() -> None:
    runs = [sine_run(104, 3, seed=s) for s in range(12)]
    found = []
    for run in runs:
        fit = refine(traces_of(Recording((run,))), Structure(), start(), None, 5)
        scale = np.sqrt(np.diag(fit.information))
        bound = np.sqrt(np.diag(np.linalg.inv(fit.information / np.outer(scale, scale)))) / scale * fit.sigma
        found.append((fit.vector - TRUTH) / bound)
    assert np.all(np.abs(found) < 4.5)
    assert 0.5 < float(np.std(found)) < 1.6


def test_a_simulation_that_runs_away_is_said_and_not_followed() -> None:
    unstable = start() | {("stiffness",): -9e4}
    found = refine([prepare(sine_run(104, 3))], Structure(), unstable, None, 5)
    assert not np.isfinite(found.sigma)


def test_parameters_stay_ordered_and_within_what_their_effect_allows() -> None:
    names = names_of(Structure(("inertia",), ("stribeck_friction",)), 1)
    swapped = ordered(names, np.array([0.02, 3.0, 1.0, 0.1]))
    np.testing.assert_allclose(swapped, [0.02, 2.0, 2.0, 0.1])
    assert bounds_of(("torque_delay", "delay")) == (0.0, 0.2)
    assert bounds_of(("inertia",))[0] > 0


def test_a_parameter_that_differs_from_run_to_run_has_a_name_for_each() -> None:
    names = names_of(Structure((), ("periodic_disturbance",)), 2)
    assert ("periodic_disturbance", "sine", "1") in names
    assert ("periodic_disturbance", "frequency") in names
