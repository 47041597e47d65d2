"""A current loop that lags and an amplifier that clips give another torque in the other order: both are tried."""

from __future__ import annotations

import numpy as np
import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.select.trial_fits import TrialFits
from identify.signals.prepare import one_noise, prepare
from tests.identify.simulated import TRUTH, sine_run

PLATFORM: dict[Name, float] = dict(zip([("inertia",), ("damping",), ("stiffness",)], TRUTH, strict=True))
LAG, CLIPS = "actuator_lag", "torque_saturation"


@pytest.mark.parametrize(
    ("names", "other"),
    [
        ((CLIPS, LAG), (LAG, CLIPS)), ((LAG, CLIPS), (CLIPS, LAG)),
        (("torque_deadzone", LAG), (LAG, "torque_deadzone")),
        ((CLIPS, "sensor_lag", LAG), (LAG, CLIPS, "sensor_lag")),
        ((CLIPS, "torque_delay"), None), ((LAG, "torque_delay"), None), ((CLIPS, "sensor_lag"), None), ((LAG,), None),
        ((), None),
    ],
)  # fmt: skip
def test_the_order_matters_where_one_spreads_and_the_other_bends(
    names: tuple[str, ...], other: tuple[str, ...] | None
) -> None:
    swapped = Structure(effects=names).other_order()
    assert (swapped.effects if swapped else None) == other


@pytest.mark.parametrize("true", [(LAG, CLIPS), (CLIPS, LAG)], ids=["lags first", "clips first"])
def test_what_is_added_last_acts_where_it_fits_better(true: tuple[str, str]) -> None:
    values = {LAG: {"time": 0.02}, CLIPS: {"limit": 25.0}}
    runs = [sine_run(60.0, f, effects={n: values[n] for n in true}, duration_s=2.0) for f in (2.0, 6.0)]
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    clipped: dict[Name, float] = {**PLATFORM, (CLIPS, "limit"): 25.0}
    now = problem.fit(Structure(effects=(CLIPS,)), clipped, iterations=5, thorough=False)
    trials = TrialFits(problem, Structure(), [LAG, CLIPS], None)  # type: ignore[arg-type]
    start: dict[Name, float] = {(LAG, "time"): 0.01}
    found = trials.fitted(now, LAG, [start])
    assert found is not None
    assert found.structure.effects == true
    assert found.values[(LAG, "time")] == pytest.approx(0.02, rel=0.02)
    assert np.isclose(found.values[("inertia",)], TRUTH[0], rtol=2e-3)
