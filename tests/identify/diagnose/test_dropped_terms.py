"""Of a model whose damping was dropped, what is left may be the damping: the curve over the rate has a line then."""

from __future__ import annotations

import numpy as np

from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.runs.holdout import split
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, sine_run, traces_of

SETS = ((111.0, 1.0), (104.0, 3.0), (67.0, 6.0))
DAMPED = (TRUTH[0], 2.0, TRUTH[2])


def left(*terms: str) -> Disturbance:
    runs = tuple(sine_run(m, f, seed=k, jck=DAMPED) for k, (m, f) in enumerate(SETS))
    traces = traces_of(Recording(runs))
    along = TorqueRegression(traces, split(traces, "auto"), 20.0, scale_of(traces, DAMPED, ()))
    fit = along.solve(Structure(terms), {})
    return disturbance_of(along, fit, along.noise_floor_nm(fit.values), "N*m")


def test_a_dropped_damping_shows_over_the_rate() -> None:
    found = left("inertia", "stiffness")
    assert found.depends_on[0].on == "rate"
    at, shape = np.array(found.depends_on[0].at), np.array(found.depends_on[0].shape_nm)
    assert np.isclose(np.polyfit(at, shape, 1)[0], DAMPED[1], rtol=0.1)


def test_a_damping_that_is_fitted_does_not() -> None:
    assert left("inertia", "damping", "stiffness").depends_on == ()
