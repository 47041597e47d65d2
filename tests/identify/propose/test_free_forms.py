"""Where the curve of a free form begins and ends."""

from __future__ import annotations

import numpy as np
import pytest

from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.free_forms import ranges, shaft_torque_of, torque_of
from identify.signals.prepare import one_noise, prepare
from rig import effects
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run

LEAD_S = 0.8


def test_a_curve_over_time_begins_with_the_first_sample_that_counts() -> None:
    traces = one_noise([prepare(sine_run(100.0, f, duration_s=3.0), i) for i, f in enumerate((1.0, 3.0))], False)
    use = [np.arange(len(t.measured)) * t.step_s >= LEAD_S for t in traces]
    problem = PredictionError(traces, use)
    fit = problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)})
    begin, end = ranges(problem, fit)["free_time"]
    assert begin == pytest.approx(LEAD_S, abs=0.1)
    assert end == pytest.approx(3.0, abs=0.1)


def test_a_curve_over_the_torque_is_one_over_what_the_drive_passes_on() -> None:
    clips: dict[str, dict[str, float]] = {"torque_saturation": {"limit": 30.0}}
    problem = PredictionError(one_noise([prepare(sine_run(100.0, 2.0, effects=clips, duration_s=2.0))], False))
    start = {**{(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}, ("torque_saturation", "limit"): 30.0}
    fit = problem.fit(Structure(effects=("torque_saturation",)), start, iterations=2, thorough=False)
    assert ranges(problem, fit)["free_torque"] == pytest.approx((-30.0, 30.0), rel=0.01)
    (shaft,) = shaft_torque_of(fit)
    assert len(shaft) == len(problem.traces[0].measured)
    assert np.max(np.abs(shaft)) == pytest.approx(30.0, rel=0.01)


def test_the_time_of_a_part_of_a_run_is_that_of_the_run() -> None:
    part = one_noise([prepare(sine_run(100.0, 2.0, duration_s=8.0))], False)[0].piece(5000, 7000)
    problem = PredictionError([part])
    start = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    fit = problem.fit(Structure(), start, iterations=1, thorough=False)
    assert ranges(problem, fit)["free_time"] == pytest.approx((5.4, 7.0), abs=0.1)  # behind a lead
    grows = dict(zip([p.name for p in effects.get("free_time").parameters], (5.4, 7.0, 1.0), strict=False))
    at: dict[tuple[str, ...], float] = {("free_time", n): grows.get(n, 0.0) for n in _names("free_time")}
    curved = problem.fit(Structure(effects=("free_time",)), {**start, **at}, fit.noise, 0, thorough=False)
    (torque,) = torque_of(problem, curved, "free_time")
    assert torque[400] == pytest.approx(1.0, abs=0.05)  # where the curve begins
    assert torque[-1] == pytest.approx(1.0, abs=0.1)  # and where it ends


def _names(form: str) -> list[str]:
    return [p.name for p in effects.get(form).parameters]
