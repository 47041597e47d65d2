"""Least squares in torque on runs that a lost sample cuts into pieces, each with an angle and a bias of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.coloured_residual import bounded
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.signals.trace import Trace
from rig.recording.run import Recording, Run
from tests.identify.simulated import TRUTH, sine_run, traces_of

SETS = ((111.0, 1.0), (104.0, 3.0), (67.0, 6.0))


def with_holes(run: Run, *at: int) -> Run:
    """A run in which sixty samples are missing at every place: what comes after a place begins anew."""
    valid = run.valid.copy()
    for i in at:
        valid[i : i + 60] = False
    return replace(run, valid=valid)


def regression(*at: int) -> TorqueRegression:
    runs = tuple(with_holes(sine_run(m, f, seed=i), *at) for i, (m, f) in enumerate(SETS))
    traces: list[Trace] = traces_of(Recording(runs))
    return TorqueRegression(traces, split(traces, "auto"), 50.0, scale_of(traces, TRUTH, ()))


def test_a_column_without_a_sample_explains_nothing() -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((400, 15)) * np.geomspace(1e-3, 1e3, 15)
    a[:, 5:8] = 0.0
    y = rng.standard_normal(400)
    x = bounded(a.T @ a, a.T @ y, np.full(15, -np.inf))
    assert not np.any(x[5:8])
    there = [k for k in range(15) if k not in (5, 6, 7)]
    np.testing.assert_allclose(x[there], np.linalg.lstsq(a[:, there], y, rcond=None)[0], rtol=1e-6)


@pytest.mark.parametrize("at", [(), (1500,), (3560,)])
def test_pieces_between_lost_samples_are_held_out_as_well_as_whole_runs(at: tuple[int, ...]) -> None:
    fit = regression(*at).solve(Structure(), {})
    assert fit.held_nm < 2.0 * fit.sigma


def test_a_motion_that_does_not_stand_out_of_its_noise_is_looked_at_as_a_whole() -> None:
    runs = tuple(sine_run(m, f, seed=i) for i, (m, f) in enumerate(SETS))
    traces = [replace(t, noise=1e6 * t.noise) for t in traces_of(Recording(runs))]
    found = TorqueRegression(traces, split(traces, "auto"), 50.0, scale_of(traces, TRUTH, ()))
    assert len(found.at_rows(found.ahead("rate"))) > 100 and np.isfinite(found.torque_nm)
    assert found.noise_floor_nm({("inertia",): 0.02}) > 0.0
