"""Runs without torque: what they swing on by is named, in ratios to the inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.pipeline import identify
from rig.arrays import Array
from rig.config.identify import IdentifyConfig
from rig.errors import RecordingError
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import decay_run, traces_of

GRAVITY, COULOMB, DRAG = 33.0, 0.05, 0.005
QUIET = IdentifyConfig()


def pendulum(
    step_s: float = 0.005, duration_s: float = 90.0, gusts: float = 0.0, wander_rad: float = 0.0, seed: int = 3
) -> Run:
    """Released from 0.9 rad; a draught pushes it, and the encoder errs slowly besides its noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration_s, step_s)
    knots = np.arange(0.0, duration_s + 4.0, 2.0)
    push = gusts * rng.standard_normal(len(knots))

    def slope(t: float, y: Array) -> list[float]:
        friction = COULOMB * np.tanh(y[1] / 1e-3) + DRAG * y[1] * abs(y[1])
        return [y[1], float(np.interp(t, knots, push)) - GRAVITY * np.sin(y[0]) - friction]

    moved = solve_ivp(slope, (0.0, duration_s), [0.9, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.02)
    decay = np.exp(-step_s / 0.05)
    error = np.zeros(len(time))
    steps = wander_rad * np.sqrt(1.0 - decay**2) * rng.standard_normal(len(time))
    for i in range(1, len(time)):
        error[i] = decay * error[i - 1] + steps[i]
    angle = moved.y[0] + error + 1e-4 * rng.standard_normal(len(time))
    return Run("decay", time, np.ones(len(time), dtype=bool), angle_rad=angle)


@pytest.mark.parametrize(
    "offered",
    [
        ["unbalance", "coulomb_friction", "quadratic_damping"],
        pytest.param(None, marks=pytest.mark.slow),  # the whole library
    ],
)
def test_a_decay_at_the_sensors_noise_names_gravity_friction_and_drag(offered: list[str] | None) -> None:
    settings = IdentifyConfig.model_validate({"candidates": offered})
    found = identify(Recording((pendulum(0.01, 15.0),)), Platform(1.0, 0.1, 20.0), settings)
    assert set(found.verdict.effects) == {"unbalance", "coulomb_friction", "quadratic_damping"}
    effects = found.final.effect_parameters
    assert effects["unbalance"]["sine"].value == pytest.approx(GRAVITY, rel=1e-3)
    assert effects["coulomb_friction"]["level"].value == pytest.approx(COULOMB, rel=0.02)
    assert effects["quadratic_damping"]["factor"].value == pytest.approx(DRAG, rel=0.05)
    assert found.accepted


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True, reason="Stribeck friction beside damping follows this friction as well, and comes first"
)
def test_beside_a_draught_friction_and_drag_are_named_apart() -> None:
    found = identify(Recording((pendulum(gusts=0.01),)), Platform(1.0, 0.1, 20.0), QUIET)
    assert set(found.verdict.effects) == {"unbalance", "coulomb_friction", "quadratic_damping"}


@pytest.mark.slow
def test_beside_a_draught_gravity_is_told_to_a_thousandth() -> None:
    found = identify(Recording((pendulum(gusts=0.01),)), Platform(1.0, 0.1, 20.0), QUIET)
    assert "unbalance" in found.verdict.effects
    assert found.final.effect_parameters["unbalance"]["sine"].value == pytest.approx(GRAVITY, rel=1e-3)
    assert "stiffness" in {d.name for d in found.final.dropped}


@pytest.mark.slow
def test_beside_an_encoder_that_errs_slowly_wrong_names_are_not_accepted() -> None:
    found = identify(Recording((pendulum(wander_rad=5e-4),)), Platform(1.0, 0.1, 20.0), QUIET)
    right = set(found.verdict.effects) == {"unbalance", "coulomb_friction", "quadratic_damping"}
    assert right or (not found.accepted and found.verdict.unexplained)


def test_a_slow_error_of_the_encoder_is_no_torque() -> None:
    """Taken for a torque disturbance it would be so large that nothing is to be seen of the friction."""
    problem = PredictionError(traces_of(Recording((pendulum(duration_s=30.0, wander_rad=5e-4),))))
    start = {("inertia",): 1.0, ("unbalance", "sine"): GRAVITY, ("coulomb_friction", "level"): COULOMB}
    structure = Structure(("inertia",), ("unbalance", "coulomb_friction", "quadratic_damping"))
    fit = problem.fit(structure, start)
    wander = float(np.sqrt(0.5 * fit.noise.walk * fit.noise.walk_s * fit.variance))
    assert wander == pytest.approx(5e-4, rel=0.3)
    assert fit.noise.walk_s == pytest.approx(0.05, rel=0.5)
    assert fit.reduced_chi_square < 1.1
    assert fit.values[("coulomb_friction", "level")] == pytest.approx(COULOMB, rel=0.05)


def test_where_a_decay_began_is_fitted_though_the_smoothed_start_is_off() -> None:
    run = decay_run(Platform(1.0, 0.02, 30.0), duration_s=20.0)
    problem = PredictionError(traces_of(Recording((run,))))
    start = {("inertia",): 1.0, ("damping",): 0.05, ("stiffness",): 29.0}
    fit = problem.fit(Structure(), start)
    assert fit.values[("stiffness",)] == pytest.approx(30.0, rel=1e-4)
    assert fit.values[("damping",)] == pytest.approx(0.02, rel=0.02)
    assert fit.reduced_chi_square == pytest.approx(1.0, abs=0.05)


def test_an_added_inertia_without_torque_is_refused_with_what_to_do() -> None:
    bare = pendulum(duration_s=20.0)
    loaded = replace(bare, name="with ring", added_inertia_kg_m2=0.02)
    with pytest.raises(RecordingError, match=r"with ring .* 0\.02 .*each load separately"):
        identify(Recording((bare, loaded)), Platform(1.0, 0.1, 20.0), QUIET)
