"""A free decay that no library describes down to its sensor's noise: gravity, friction and drag are told anyway."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identify.pipeline import identify
from identify.select.decay_search import PLENTY, thinned
from rig.config.identify import IdentifyConfig
from rig.errors import RecordingError
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run

GRAVITY, COULOMB, DRAG = 21.0, 0.06, 0.007  # over the inertia


def decay(step_s: float = 0.005, duration_s: float = 90.0) -> Run:
    """Released from 0.9 rad; a draught that no effect describes keeps it 20 times above the encoder's noise."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, duration_s, step_s)
    knots = np.arange(0.0, duration_s + 4.0, 2.0)
    gusts = 0.01 * rng.standard_normal(len(knots))

    def slope(t: float, y: Array) -> list[float]:
        friction = COULOMB * np.tanh(y[1] / 1e-3) + DRAG * y[1] * abs(y[1])
        return [y[1], float(np.interp(t, knots, gusts)) - GRAVITY * np.sin(y[0]) - friction]

    moved = solve_ivp(slope, (0.0, duration_s), [0.9, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.02)
    angle = moved.y[0] + 1e-4 * rng.standard_normal(len(time))
    return Run("decay", time, np.ones(len(time), dtype=bool), angle_rad=angle)


@pytest.mark.slow
def test_gravity_friction_and_drag_are_named_in_the_order_of_what_they_explain() -> None:
    found = identify(Recording((decay(),)), Platform(1.0, 0.1, 20.0), IdentifyConfig())
    assert found.verdict.effects == ("unbalance", "coulomb_friction", "quadratic_damping")
    assert found.verdict.unexplained
    effects = found.final.effect_parameters
    assert effects["unbalance"]["sine"].value == pytest.approx(GRAVITY, rel=0.01)
    assert effects["coulomb_friction"]["level"].value == pytest.approx(COULOMB, rel=0.15)
    assert effects["quadratic_damping"]["factor"].value == pytest.approx(DRAG, rel=0.25)
    assert {d.name for d in found.final.dropped} >= {"damping", "stiffness"}


def test_a_slow_decay_is_searched_in_every_so_manyth_sample() -> None:
    run = decay(step_s=0.001, duration_s=60.0)
    (few,) = thinned([run], 0.7)
    every = round((few.time_s[1] - few.time_s[0]) / 0.001)
    assert len(few.time_s) >= PLENTY
    assert every > 1
    assert few.angle_rad is not None and run.angle_rad is not None
    assert np.array_equal(few.angle_rad, run.angle_rad[::every])
    assert len(few.valid) == len(few.time_s)


def test_a_short_run_beside_long_ones_keeps_enough_samples_to_be_used() -> None:
    long, short = decay(step_s=0.001, duration_s=60.0), decay(step_s=0.001, duration_s=0.3)
    assert min(len(r.time_s) for r in thinned([long, short], 0.7)) >= 200


def test_a_fast_decay_keeps_every_sample() -> None:
    run = decay(step_s=0.001, duration_s=60.0)
    assert thinned([run], 30.0) == [run]


def test_an_added_inertia_without_torque_is_refused_with_what_to_do() -> None:
    bare, loaded = decay(duration_s=20.0), replace(decay(duration_s=20.0), name="with ring", added_inertia_kg_m2=0.02)
    with pytest.raises(RecordingError, match=r"with ring .* 0\.02 .*each load by themselves"):
        identify(Recording((bare, loaded)), Platform(1.0, 0.1, 20.0), IdentifyConfig())
