"""Free-form curves over angle, rate, direction, torque, time and past motion, beside a model in torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.diagnose.terms.changing import with_load, with_time
from identify.diagnose.terms.free_form import SHAPE_POINTS, FreeForm, smooth_splines
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from rig.arrays import Array

OUTER = (0.8, 0.95)  # shares of the samples inside of which nothing is touched
PAST_RUN_SHARES = (0.05, 0.5)  # of the run: time constants with which a rate is remembered


def curves(regression: TorqueRegression, fit: TorqueFit) -> list[FreeForm]:
    """The terms that are tried, without what the model has of the same quantity.

    Of a model whose damping was dropped, what goes with the rate is also what is linear in it; and so with the angle.
    """
    _, rate, _, _, time, run = regression.series()
    slow = 0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300
    angles, rates = regression.ahead("angle"), regression.ahead("rate")
    # Over the recorded torque, and over what the model explains of it: a controller answers a disturbance, which is in
    # the first then, and a torque of a few levels is the second and what is left. What is real shows over both.
    torques = [] if regression.torque_free else [regression.ahead("torque"), regression.ahead("torque", fit.residuals)]
    driven = [_spline("torque", regression, torque) for torque in torques]
    ends = np.array([-1.0, 1.0])
    out = [
        _spline("angle", regression, angles, "stiffness" not in fit.structure.terms),
        _beyond("angle", regression, angles),
        _spline("rate", regression, rates, "damping" not in fit.structure.terms), *driven,
        FreeForm("direction", regression.along(rates, lambda v: np.tanh(v / slow)[:, None]), ends, ends[:, None]),
    ]  # fmt: skip
    if float(np.max(time)) > 0.0:
        # A spring turns what a gyro's bias makes of the angle into a torque that wanders.
        drifts = regression.by_gyro and "stiffness" in fit.structure.terms and any(t.biased for t in regression.traces)
        out += [*([] if drifts else [_over_time(time)]), *with_time(regression)]
    out += [_history(rate, run, regression), *([] if regression.torque_free else with_load(regression))]
    return [f for f in out if f.columns.shape[1] > 0 and np.all(np.isfinite(f.columns))]


def _spline(on: str, regression: TorqueRegression, series: Sequence[Array], with_line: bool = False) -> FreeForm:
    """A smoothing spline of a quantity without what is constant and linear in it; a line of its own beside it."""
    x = regression.at_rows(series)
    free, at = smooth_splines(x)
    if free is None:
        return FreeForm(on, np.zeros((len(regression.series()[0]), 0)), np.zeros(0), np.zeros((0, 0)))

    def straight(values: Array) -> Array:
        return np.column_stack([np.ones(len(values)), values])

    # Of a torque that is noisy or in steps, a curve behind the low-pass has a line that it has not ahead of it.
    columns, line = regression.along(series, free), regression.along(series, straight)
    slope = np.linalg.lstsq(line, columns, rcond=None)[0]
    columns, shape = columns - line @ slope, free(at) - straight(at) @ slope
    rough = np.ones(columns.shape[1] + with_line, dtype=np.bool_)
    if with_line:
        rough[-1] = False
        columns, shape = np.column_stack([columns, line[:, 1]]), np.column_stack([shape, at])
    return FreeForm(on, columns, at, shape, over=x, rough=rough)


def _over_time(time: Array) -> FreeForm:
    """The same of the time in a run, with its line: no model has that, but for a gyro's bias."""
    free, at = smooth_splines(time)
    if free is None:
        return FreeForm("time", np.zeros((len(time), 0)), np.zeros(0), np.zeros((0, 0)))
    middle, span = float(np.mean(time)), float(np.ptp(time))

    def with_line(values: Array) -> Array:
        return np.column_stack([free(values), (values - middle) / span])

    rough = np.append(np.ones(free(at).shape[1], dtype=np.bool_), False)
    return FreeForm("time", with_line(time), at, with_line(at), over=time, rough=rough)


def _beyond(on: str, regression: TorqueRegression, series: Sequence[Array]) -> FreeForm:
    """What begins at the ends of a quantity's range, as a stop does: straight from the outer shares of samples on."""
    x = regression.at_rows(series)
    middle = float(np.median(x))
    starts = [(s, float(np.quantile(s * (x - middle), share))) for s in (-1.0, 1.0) for share in OUTER]

    def hinges(values: Array) -> Array:
        return np.stack([s * np.maximum(s * (values - middle) - b, 0.0) for s, b in starts], axis=1)

    at = np.linspace(float(np.min(x)), float(np.max(x)), SHAPE_POINTS)
    return FreeForm(on, regression.along(series, hinges), at, hinges(at))


def _history(rate: Array, run: Array, regression: TorqueRegression) -> FreeForm:
    """The direction of the motion as it was a while ago, with two lengths of memory."""
    direction = np.tanh(rate / (0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300))
    out = np.zeros((len(rate), len(PAST_RUN_SHARES)))
    for k in np.unique(run):
        here = np.nonzero(run == k)[0]
        for j, share in enumerate(PAST_RUN_SHARES):
            memory, decay = 0.0, float(np.exp(-1.0 / max(share * 0.1 * len(here), 1.0)))
            for i in here:
                memory = decay * memory + (1.0 - decay) * direction[i]
                out[i, j] = memory
    return FreeForm("history", out, np.zeros(0), np.zeros((0, len(PAST_RUN_SHARES))))
