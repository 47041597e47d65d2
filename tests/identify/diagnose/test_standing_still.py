"""Where the platform stands, static friction takes any torque; a gyro's bias must not pass for a motion there."""

from __future__ import annotations

import numpy as np
import pytest

from identify.diagnose.low_passed_torque import _read_at_rest
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.recording.run import Recording, Run
from tests.identify.simulated import sine_run, traces_of

INERTIA, DAMPING, STIFFNESS, LEVEL = 5e-4, 0.012, 4.5, 0.014


def moved_to(places: list[float], bias: float, seed: int) -> Run:
    """Moves from place to place, each of 0.2 s and followed by 0.6 s of rest, where friction holds with any torque."""
    rng = np.random.default_rng(seed)
    parts: list[tuple[Array, Array, Array, Array]] = []
    here, x = 0.0, np.arange(200) / 200.0
    for place in places:
        way = place - here
        rate = way * (1.0 - np.cos(2.0 * np.pi * x)) / 0.2
        angle = here + way * (x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi))
        parts.append((angle, rate, way * 2.0 * np.pi * np.sin(2.0 * np.pi * x) / 0.04, np.full(200, np.sign(way))))
        held = rng.uniform(-1.0, 1.0)
        parts.append((np.full(600, place), np.zeros(600), np.zeros(600), np.full(600, held)))
        here = place
    angle, rate, acceleration, friction = (np.concatenate([p[k] for p in parts]) for k in range(4))
    torque = INERTIA * acceleration + DAMPING * rate + STIFFNESS * angle + LEVEL * friction
    time = np.arange(len(rate)) * 1e-3
    read = rate + bias + 7e-4 * rng.standard_normal(len(rate))
    return Run(f"run {seed}", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time, torque_nm=torque)


def traces(bias: float) -> list[Trace]:
    places = ([0.03, -0.02, 0.05, 0.0], [-0.04, 0.02, -0.01, 0.04], [0.05, 0.01, -0.03, 0.02])
    return traces_of(Recording(tuple(moved_to(p, bias, seed) for seed, p in enumerate(places))))


@pytest.mark.parametrize("bias", [0.0, 0.013, -0.02])
def test_a_gyro_that_stands_reads_its_bias(bias: float) -> None:
    for trace in traces(bias):
        assert _read_at_rest(trace, 20.0) == pytest.approx(bias, abs=5e-4)


def test_a_motion_that_never_rests_reads_nothing_most_often() -> None:
    for trace in traces_of(Recording((sine_run(60.0, 3.0), sine_run(40.0, 1.0)))):
        assert _read_at_rest(trace, 20.0) == 0.0


def test_what_friction_holds_at_rest_is_no_part_of_a_fit_in_torque() -> None:
    runs = traces(0.013)
    scale = scale_of(runs, (INERTIA, DAMPING, STIFFNESS), ())
    regression = TorqueRegression(runs, split(runs, "auto"), 20.0, scale)
    fit = regression.solve(Structure(effects=("coulomb_friction",)), {})
    assert fit.values["stiffness",] == pytest.approx(STIFFNESS, rel=0.02)
    assert fit.values["coulomb_friction", "level"] == pytest.approx(LEVEL, rel=0.1)
