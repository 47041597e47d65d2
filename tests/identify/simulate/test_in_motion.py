"""Where a stretch begins in motion, what is inside the platform moves as nobody knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from identify.simulate.shots import Shots, make_shots
from tests.identify.simulated import TRUTH, sine_run

MODE = {"flexible_mode": {"inertia": 0.006, "frequency": 53.0, "ratio": 0.03}}
PLATFORM = dict(zip((("inertia",), ("damping",), ("stiffness",)), TRUTH, strict=True))
GAP = slice(1500, 1540)


def with_a_gap() -> Trace:
    run = sine_run(104.0, 3.0, effects=MODE, duration_s=3.0)
    valid = run.valid.copy()
    valid[GAP] = False
    return prepare(replace(run, valid=valid))


def shots_of(trace: Trace) -> Shots:
    return make_shots(trace, 2, None)


def test_behind_a_gap_a_run_goes_on_in_motion() -> None:
    shots = shots_of(with_a_gap())
    assert [0.0 if first * 1e-3 < 0.1 else 1.0 for first in shots.first] == [float(x) for x in shots.in_motion]
    assert shots.in_motion[-1]
    assert not shots.in_motion[0]


def test_a_part_of_a_run_begins_in_motion_and_so_does_one_that_moves() -> None:
    trace = prepare(sine_run(104.0, 3.0, duration_s=1.0))
    assert not any(shots_of(trace).in_motion)
    assert all(shots_of(replace(trace, offset_s=1.0)).in_motion)
    moving = replace(trace, measured=trace.measured + 3.0, motion=None)
    assert all(shots_of(moving).in_motion)


def test_a_mode_is_found_right_behind_a_gap() -> None:
    """Taken for at rest behind it, the payload would ring on in the innovations: a mode was not found at all."""
    trace = with_a_gap()
    problem = PredictionError([trace])
    own = {("flexible_mode", name): value for name, value in MODE["flexible_mode"].items()}
    fit = problem.fit(Structure(effects=("flexible_mode",)), {**PLATFORM, **own})
    for name, value in {**PLATFORM, **own}.items():
        assert abs(fit.values[name] - value) < 4.0 * fit.std_error(name), name
    assert fit.reduced_chi_square < 1.1
    innovations, variance = fit.prediction.innovations[0], fit.prediction.variance[0] * fit.variance
    behind = slice(GAP.stop + 25, GAP.stop + 200)
    assert np.mean(innovations[behind] ** 2 / variance[behind]) < 1.5
