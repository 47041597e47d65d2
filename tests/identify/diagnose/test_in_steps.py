"""A converter that gives the torque in coarse steps is told with the size of these, and noise has none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from identify.conclude.verdict import residual_torque_sentence
from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.runs.holdout import split
from rig.arrays import Array
from rig.recording.run import Recording
from tests.identify.diagnose.driven import run_driven
from tests.identify.simulated import TRUTH, traces_of

STEPS_NM = 4.0


def left_of(*drives: Callable[[Array], Array]) -> Disturbance:
    """What the plain model leaves of runs by such drives, one each."""
    recording = Recording(tuple(run_driven(drive, i) for i, drive in enumerate(drives)))
    traces = traces_of(recording)
    regression = TorqueRegression(traces, split(traces, "auto"), 30.0, scale_of(traces, TRUTH, ()))
    fit = regression.solve(Structure(), {})
    return disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m")


def rounded(asked: Array) -> Array:
    return STEPS_NM * np.round(asked / STEPS_NM)


def test_a_torque_in_coarse_steps_is_told_with_their_size() -> None:
    left = left_of(rounded)
    (part,) = left.depends_on
    assert part.on == "torque"
    assert part.step_nm == pytest.approx(STEPS_NM, rel=0.01)
    assert part.relative > 0.8 * left.relative
    assert "depends on the torque, as if the drive gave it in steps of 4" in residual_torque_sentence(left, "rotary")


def test_a_torque_that_is_noisy_has_no_steps() -> None:
    def noisy(asked: Array) -> Array:
        return asked + np.random.default_rng(3).normal(0.0, STEPS_NM, len(asked))

    assert left_of(noisy).depends_on == ()
