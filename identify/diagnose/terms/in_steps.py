"""A torque that acts in coarser steps than it is asked for: the sawtooth over the torque that rounding leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.diagnose.terms.free_form import FreeForm
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from rig.arrays import Array

FEWEST_STEPS, MOST_STEPS = 4.0, 200.0  # over the range of the torque: of fewer a smooth curve over the torque tells
STEPS_APART, STEPS_APART_NEAR = (
    0.25,
    0.02,
)  # of their number, that is tried next: a quarter of a line's width, and finer
SEARCHED_SAMPLES = 20_000  # of all runs, for the number of steps
SAWTOOTH_WAVES = 3  # of a sawtooth: all but a tenth of its power


def in_steps(regression: TorqueRegression, fit: TorqueFit) -> list[FreeForm]:
    """The first waves of a sawtooth over the torque, as long as the step that fits the residual best."""
    if regression.torque_free:
        return []
    torques = regression.ahead("torque")
    explained = regression.ahead("torque", fit.residuals)
    step_nm = _step_nm(np.concatenate(torques), np.concatenate(torques) - np.concatenate(explained))
    if step_nm is None:
        return []

    def waves(torque: Array) -> Array:
        phase = 2.0 * np.pi / step_nm * torque[:, None] * np.arange(1, SAWTOOTH_WAVES + 1)
        return np.concatenate([np.sin(phase), np.cos(phase)], axis=1)

    columns = regression.along(torques, waves)
    return [FreeForm("torque", columns, np.zeros(0), np.zeros((0, columns.shape[1])), step_nm=step_nm)]


def _step_nm(torque: Array, left: Array) -> float | None:
    """The step over which a residual, (n,), repeats most; None of a torque that does not change."""
    apart = max(1, len(torque) // SEARCHED_SAMPLES)
    low, high = float(np.min(torque)), float(np.max(torque))
    if not high > low:
        return None
    share, left = (torque[::apart] - low) / (high - low), left[::apart] - np.mean(left)
    coarse = np.arange(FEWEST_STEPS, MOST_STEPS, STEPS_APART)
    best = coarse[np.argmax(_power(share, left, coarse))]
    near = best + np.arange(-STEPS_APART, STEPS_APART, STEPS_APART_NEAR)
    return (high - low) / float(near[np.argmax(_power(share, left, near))])


def _power(share: Array, left: Array, numbers: Sequence[float] | Array) -> Array:
    """Power of a residual at waves over the torque, ``numbers`` of them, evenly apart, over its range."""
    wave = left * np.exp(2j * np.pi * numbers[0] * share)
    onward = np.exp(2j * np.pi * (numbers[1] - numbers[0]) * share)
    out = np.empty(len(numbers))
    for k in range(len(numbers)):
        out[k] = abs(np.sum(wave)) ** 2
        wave *= onward
    return out
