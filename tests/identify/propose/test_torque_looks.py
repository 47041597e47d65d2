"""Where the search is told to begin by what a candidate takes of the torque along the measured motion."""

from __future__ import annotations

import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.propose.shape_grids import grid_of
from identify.propose.torque_looks import candidate_torques
from identify.runs.holdout import split
from rig import effects
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, sine_run, traces_of

LARGEST_NM = 111.0


@pytest.mark.parametrize("share", [0.89, 0.905, 0.935])
def test_a_torque_limit_between_the_values_of_its_grid_is_where_the_fit_begins(share: float) -> None:
    """From the value of the grid beyond it a fit ended where the limit clips nothing, worse than without it."""
    hidden = {"torque_saturation": {"limit": share * LARGEST_NM}}
    runs = [sine_run(m, f, seed=i, effects=hidden) for i, (m, f) in enumerate(((LARGEST_NM, 1.0), (67.0, 6.0)))]
    traces = traces_of(Recording(tuple(runs)))
    scale = scale_of(traces, TRUTH, ())
    (grid,) = zip(*grid_of(effects.get("torque_saturation"), scale), strict=True)
    assert min(abs(x - share * LARGEST_NM) for x in grid) > 0.005 * LARGEST_NM
    regression = TorqueRegression(traces, split(traces, "auto"), 50.0, scale)
    now = regression.solve(Structure(), {})
    (look, *_) = candidate_torques(regression, now, ["torque_saturation", "cubic_stiffness"], 2)
    assert look.effect == "torque_saturation"
    assert look.start[("torque_saturation", "limit")] == pytest.approx(share * LARGEST_NM, rel=2e-3)
