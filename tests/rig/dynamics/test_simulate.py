"""Whole sets, single steps and shots are one and the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from rig.dynamics import Equations, Grid, Stepper, TorqueSignal, simulate
from rig.platform import Platform
from tests.rig.dynamics.exact import moved_by_a_held_torque

TIME = np.arange(1001) * 1e-3
SINE = TorqueSignal(TIME, 40.0 * np.sin(2 * np.pi * 9 * TIME))
HELD = TorqueSignal(TIME, SINE.torque_nm, "zero_order")
COULOMB = {"coulomb_friction": {"level": 1.2}}


@pytest.mark.parametrize("effects", [{}, COULOMB, {"creep": {"stiffness": 10.0, "time": 0.2}}], ids=str)
def test_a_rig_played_step_by_step_moves_as_the_set_simulated_whole(effects: dict[str, dict[str, float]]) -> None:
    platform = Platform(effects=effects)
    stepper = Stepper(platform, 1e-3)
    rates = [stepper.advance(m, m)[1] for m in HELD.torque_nm[:-1]]
    whole = simulate(platform, TIME, HELD, substeps=stepper.substeps).rate_rad_s
    np.testing.assert_allclose(rates, whole[1:], rtol=0, atol=1e-10)


def test_step_by_step_a_delay_and_a_sensor_lag_act_as_in_the_whole_set() -> None:
    platform = Platform(effects={"torque_delay": {"delay": 1.5e-3}, "sensor_lag": {"time": 2e-3}})
    stepper = Stepper(platform, 1e-3)
    sensed = [stepper.advance(a, b)[2] for a, b in zip(SINE.torque_nm[:-1], SINE.torque_nm[1:], strict=True)]
    whole = simulate(platform, TIME, SINE, substeps=16).sensed_rate_rad_s
    assert np.max(np.abs(np.array(sensed) - whole[1:])) < 3e-3 * np.max(np.abs(whole))


@pytest.mark.parametrize("effects", [COULOMB, {"torque_delay": {"delay": 1.5e-3}}], ids=str)
def test_a_grid_with_its_torque_multiplied_is_the_grid_of_the_larger_torque(
    effects: dict[str, dict[str, float]],
) -> None:
    equations = Equations(Platform(effects=effects))
    small = Grid(TIME, SINE, 4)
    before = small.simulate(equations, (0.0, 0.0))
    large = small.scaled(1.5).simulate(equations, (0.0, 0.0))
    whole = Grid(TIME, TorqueSignal(TIME, 1.5 * SINE.torque_nm), 4).simulate(equations, (0.0, 0.0))
    np.testing.assert_allclose(large.rate_rad_s, whole.rate_rad_s, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(small.simulate(equations, (0.0, 0.0)).rate_rad_s, before.rate_rad_s)


def test_a_stepper_that_is_reset_forgets_everything() -> None:
    stepper = Stepper(Platform(effects={"torque_delay": {"delay": 5e-3}}), 1e-3)
    first = [stepper.advance(20.0, 20.0) for _ in range(50)]
    stepper.reset()
    assert [stepper.advance(20.0, 20.0) for _ in range(50)] == first


def test_sample_times_that_jitter_are_met_where_they_are() -> None:
    jitter = TIME + np.random.default_rng(3).uniform(-3e-4, 3e-4, len(TIME))
    jitter[0] = 0.0
    dense_time = np.arange(20001) * 5e-5
    dense = simulate(Platform(), dense_time, SINE, substeps=1).rate_rad_s
    late = simulate(Platform(), jitter, SINE, substeps=16).rate_rad_s
    assert np.max(np.abs(late - np.interp(jitter, dense_time, dense))) < 2e-4 * np.max(np.abs(dense))


def test_shots_begun_from_the_true_state_repeat_the_whole_run() -> None:
    equations = Equations(Platform(effects=COULOMB))
    grid = Grid(TIME, SINE, 4)
    torque = grid.shaft_torque(equations)
    whole = equations.integrate(torque, grid.step_s, (0.0, 0.0))
    spans = [(0, 1200), (1200, 2500), (2500, 4000)]
    starts = np.array([whole[a, :2] for a, _ in spans])
    shot = equations.integrate_shots(torque, grid.step_s, spans, starts)
    np.testing.assert_allclose(shot[:, :2], whole[:, :2], atol=1e-9)


def test_the_shaft_torque_behind_a_delay_is_the_torque_of_earlier() -> None:
    equations = Equations(Platform(effects={"torque_delay": {"delay": 3.3e-3}}))
    grid = Grid(TIME, SINE, 4)
    late = grid.shaft_torque(equations)[:, 0]
    at = grid.step_s * np.arange(len(late))
    settled = at > 0.01
    np.testing.assert_allclose(late[settled], SINE.at(at[settled] - 3.3e-3), atol=1e-6 * 40)


def test_more_inertia_or_less_spring_asks_for_fewer_fine_steps() -> None:
    def steps(**p: float) -> int:
        return Equations(Platform(**p)).substeps(1e-3)  # type: ignore[arg-type]

    assert steps(inertia_kg_m2=0.2) < steps() < steps(stiffness_nm_rad=7000.0)


@pytest.mark.parametrize(
    ("effects", "missing"),
    [
        ({"coulomb_friction": {}}, "level"),
        ({"coulomb_friction": {"level": 1.0, "slope": 2.0}}, "slope"),
        ({"glue": {}}, "glue"),
    ],
)
def test_an_unknown_effect_or_parameter_is_named(effects: dict[str, dict[str, float]], missing: str) -> None:
    with pytest.raises(KeyError, match=missing):
        simulate(Platform(effects=effects), TIME, SINE)


@pytest.mark.parametrize("late_s", [0.0, 3e-5, 1.25e-4, 2e-4, 3.1e-4])
def test_a_held_torque_that_changes_between_fine_steps_moves_the_platform_by_what_it_should(late_s: float) -> None:
    platform = Platform(inertia_kg_m2=0.0203, damping_nm_s_rad=0.0447, stiffness_nm_rad=681.2)
    time = np.arange(1001) * 5e-4
    changes = np.concatenate([[0.0], late_s + 1e-3 * np.arange(1, 501)])
    torque = TorqueSignal(changes, 40.0 * np.sin(2 * np.pi * 9 * changes), "zero_order")
    exact = moved_by_a_held_torque(platform, torque, time)
    found = simulate(platform, time, torque, substeps=2).rate_rad_s
    gain = float(found @ exact / (exact @ exact))
    assert gain == pytest.approx(1.0, abs=2e-5)
    assert np.sqrt(np.mean((found - exact) ** 2)) < 2e-5 * np.sqrt(np.mean(exact**2))
