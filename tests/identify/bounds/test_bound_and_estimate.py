"""What the data could determine, beside what came out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.bounds.bound_and_estimate import TOTAL, compare_with_bound
from identify.report.page.determined import determined_table
from identify.results import Identification
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import Sine
from rig.recording.run import Recording
from tests.identify.sample import SIGMA, TRUTH, estimate, sample
from tests.identify.simulated import campaign, white

FOUND, RECORDING = sample(2.0)


def reached(found: Identification, relative: float) -> Identification:
    """All final parameters with one relative standard error."""
    assert found.after is not None
    parameters = {n: estimate(p.value, relative * p.value, p.unit) for n, p in found.after.parameters.items()}
    return replace(found, after=replace(found.after, parameters=parameters))


def test_every_set_and_all_together_are_told_with_rank_and_condition() -> None:
    told = compare_with_bound(FOUND, RECORDING)
    assert [t.name for t in told] == ["0.5 Hz", "1 Hz", "3 Hz", "6 Hz", "9 Hz", TOTAL]
    assert [(t.rank, t.parameters) for t in told] == [(3, 3)] * 5 + [(5, 5)]
    assert all(np.isfinite(t.condition) for t in told)


def test_all_together_know_more_than_the_best_set_of_a_linear_model() -> None:
    linear = campaign(sets=((111.0, 0.5), (67.0, 6.0)), noise=1e-3)
    assert FOUND.after is not None
    plain = replace(FOUND, after=replace(FOUND.after, platform=replace(TRUTH, effects={})))
    *each, total = compare_with_bound(plain, linear)
    for name in ("inertia", "damping", "stiffness"):
        assert total.expected[name] < min(t.expected[name] for t in each)


def test_a_fit_at_the_bound_is_as_good_as_the_sensor_allows() -> None:
    total = compare_with_bound(FOUND, RECORDING)[-1]
    assert FOUND.after is not None
    at_bound = {n: estimate(p.value, total.expected[n] * p.value, p.unit) for n, p in FOUND.after.parameters.items()}
    again = compare_with_bound(replace(FOUND, after=replace(FOUND.after, parameters=at_bound)), RECORDING)[-1]
    assert again.sentence == "limited by sensor noise"
    assert again.achieved == pytest.approx(again.expected)


def test_a_fit_far_above_the_bound_is_limited_by_the_model() -> None:
    total = compare_with_bound(reached(FOUND, 0.02), RECORDING)[-1]
    assert "limited by the unexplained residual" in total.sentence
    assert "a standard error of 2.0 %" in total.sentence


def test_an_interval_below_the_bound_is_not_believed() -> None:
    assert "narrower than the sensor's noise allows" in compare_with_bound(reached(FOUND, 1e-9), RECORDING)[-1].sentence


def test_a_set_that_leaves_something_open_names_the_set_to_fit_it_with() -> None:
    time = np.arange(6001) * 1e-3
    torque = np.asarray(Sine(torque_nm=80.0, frequency_hz=0.5, duration_s=6.0, soft_start_s=4.0).torque(time))
    plain = replace(TRUTH, effects={})
    rate = simulate(plain, time, TorqueSignal(time, torque)).sensed_rate_rad_s + white(len(time), SIGMA)
    soft = replace(RECORDING.runs[0], time_s=time, valid=np.ones(6001, bool), rate_rad_s=rate, torque_time_s=time,
                   torque_nm=torque)  # fmt: skip
    assert FOUND.after is not None
    linear = replace(FOUND, after=replace(FOUND.after, platform=plain))
    first, *_ = compare_with_bound(linear, Recording((soft, *RECORDING.runs[1:])))
    assert "0.5 Hz alone does not determine damping" in first.sentence
    assert "fit it with" in first.sentence


def test_the_table_shows_bound_and_reached_and_the_words() -> None:
    shown = determined_table(compare_with_bound(FOUND, RECORDING)).html
    assert "bound / reached (%)" in shown
    assert TOTAL in shown
    assert "3 of 3" in shown
    assert determined_table(()).html == ""


def test_a_set_with_a_remark_of_its_own_is_not_discussed_again() -> None:
    (first, *others) = compare_with_bound(FOUND, RECORDING)
    first = replace(first, sentence="the first alone does not determine damping")
    assert "The first alone" in determined_table((first, *others)).html
    assert "The first alone" not in determined_table((first, *others), {first.name}).html


def test_without_a_model_that_can_be_simulated_nothing_is_said() -> None:
    assert FOUND.after is not None
    assert compare_with_bound(replace(FOUND, after=replace(FOUND.after, platform=None)), RECORDING) == ()
    negative = replace(TRUTH, inertia_kg_m2=-0.02)
    assert compare_with_bound(replace(FOUND, after=replace(FOUND.after, platform=negative)), RECORDING) == ()
