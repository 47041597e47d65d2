"""A drive that gives less torque as it warms up is told by the load that went before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from identify.conclude.next_steps import next_steps
from identify.conclude.verdict import residual_torque_sentence
from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.terms.changing import with_load
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.residual import Disturbance
from identify.runs.holdout import split
from rig.arrays import Array
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording, Run
from tests.identify.diagnose.driven import STEP_S, run_driven
from tests.identify.sample import sample
from tests.identify.simulated import DECLARED, TRUTH, traces_of

WARMING_S = 0.9


def warms(loss: float) -> Callable[[Array], Array]:
    """What a drive passes on that warms up with the square of the torque."""

    def drive(asked: Array) -> Array:
        kept = float(np.exp(-STEP_S / WARMING_S))
        heat = lfilter([1.0 - kept], [1.0, -kept], asked**2 / np.mean(asked**2))
        return np.asarray(asked * (1.0 - loss * heat))

    return drive


@cache
def left_of(loss: float) -> Disturbance:
    traces = traces_of(Recording(tuple(run_driven(warms(loss), i) for i in range(2))))
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    return disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m")


def test_the_gain_of_a_drive_that_warms_up_is_told_by_its_history() -> None:
    left = left_of(0.1)
    most = left.depends_on[0]
    assert (most.on, most.changes) == ("history", "gain of the drive")
    assert most.relative > 0.9 * left.relative
    said = residual_torque_sentence(left, "rotary")
    assert "depends on the past torque (as if the gain of the drive changed with it)" in said


def test_noise_of_the_recorded_torque_is_no_gain_that_changes() -> None:
    """The average gain was taken off along the torque ahead of the low-pass, with all of its noise."""
    run, rng = run_driven(warms(0.1), 0), np.random.default_rng(2)
    assert run.torque_nm is not None
    read = Run(
        run.name, run.time_s, run.valid, rate_rad_s=run.rate_rad_s, torque_time_s=run.torque_time_s,
        torque_nm=run.torque_nm + rng.normal(0.0, 30.0, len(run.torque_nm)),
    )  # fmt: skip
    regression = TorqueRegression(
        traces := traces_of(Recording((read,))), split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ())
    )
    (term,) = with_load(regression)
    torque = regression.series()[3]
    assert np.max(np.abs(torque @ term.columns)) < 1e-9 * float(torque @ torque)


def test_a_drive_that_stays_as_it_is_has_no_history() -> None:
    assert not left_of(0.0).depends_on


def test_what_to_do_about_a_drive_that_warms_up_is_said() -> None:
    found, _ = sample(1.0)
    lost = replace(found, accepted=False, verdict=replace(found.verdict, unexplained=True))
    for left, said in ((left_of(0.1), True), (left_of(0.0), False)):
        steps = next_steps(replace(lost, disturbance=left))
        assert any("motor that warms up" in step for step in steps) == said


@pytest.mark.slow
def test_an_identification_leaves_what_a_drive_that_warms_up_does_unexplained_and_says_what_to_do() -> None:
    found = identify(
        Recording(tuple(run_driven(warms(0.1), i) for i in range(2))), DECLARED, IdentifyConfig(candidates=())
    )
    assert found.verdict.unexplained
    assert any("motor that warms up" in step for step in next_steps(found))
