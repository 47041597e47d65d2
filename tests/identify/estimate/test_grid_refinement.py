"""A fit over whole runs goes on to where a finer simulation leads; what remembers begins where the run does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from identify.estimate.final_fit import by_output_error
from identify.estimate.grid_refinement import sharpened
from identify.estimate.output_error import OutputErrorFit, refine
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.signals.trace import Trace
from tests.identify.simulated import TRUTH, campaign, traces_of

QUIET = math.radians(0.002)
LATE = {"torque_delay": {"delay": 0.0013}}
MODE = {"flexible_mode": {"inertia": 0.001, "frequency": 24.0, "ratio": 0.006}}
SETS = ((104.0, 3.0), (42.0, 9.0))
START = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}


def fit(traces: list[Trace], coarse: bool) -> OutputErrorFit:
    start = START | {("torque_delay", "delay"): 0.0013}
    return refine(traces, Structure(effects=("torque_delay",)), start, None, 12, split(traces).final, coarse=coarse)


def test_a_coarse_fit_ends_where_one_with_fine_steps_does() -> None:
    traces = traces_of(campaign(LATE, sets=SETS, noise=QUIET))
    use = split(traces).final
    found = fit(traces, coarse=True)
    near = sharpened(found, traces, use, ())
    errors = np.sqrt(np.diag(np.linalg.inv(found.information))) * QUIET
    truth = np.array([*TRUTH, 0.0013])
    assert np.max(np.abs(found.vector - truth) / errors) > 5.0
    assert np.max(np.abs(near.vector - truth) / errors) < 3.5
    assert near.sigma == pytest.approx(QUIET, rel=0.03)


def test_what_is_fine_enough_already_stays_as_it_is() -> None:
    traces = traces_of(campaign(sets=SETS, noise=math.radians(1.0)))
    found = refine(traces, Structure(), START, None, 12, split(traces).final)
    assert sharpened(found, traces, split(traces).final, ()) is found


@pytest.mark.parametrize("seed", [0, 1])
def test_a_mode_that_rings_for_long_is_at_rest_where_the_run_begins_whatever_the_gyros_bias(seed: int) -> None:
    traces = traces_of(campaign(MODE, sets=SETS, noise=QUIET, bias=math.radians(0.3), seed=seed))
    found = split(traces)
    start = START | {("flexible_mode", k): v for k, v in MODE["flexible_mode"].items()}
    fitted = by_output_error(traces, Structure(effects=("flexible_mode",)), start, 0.1, found.final, found.everything)
    assert fitted.fit.sigma == pytest.approx(QUIET, rel=0.03)
    for name, truth in START.items():
        assert abs(fitted.values[name] - truth) < 3.5 * fitted.std_error(name)
