"""What a model takes for constant, changing with time, with the angle or as a wave: terms beside it in torque."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from identify.diagnose.terms.free_form import FreeForm, free_splines
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.residual import GAIN
from rig.arrays import Array

WARMING_RUN_SHARES = (0.02, 0.1, 0.5)  # of the longest run: time constants with which a drive warms up
MIN_PERIODS = 3.0  # in the longest run, of what changes as a wave: a slower change is one over the time itself


def with_time(regression: TorqueRegression) -> list[FreeForm]:
    """What angle, rate and torque pass on, changing with time: a spring that sets, grease or a drive that warms up."""
    angle, rate, _, torque, time, _ = regression.series()
    series = {"stiffness": angle, "damping": rate} | ({} if regression.torque_free else {GAIN: torque})
    along = (time - np.mean(time)) / max(float(np.ptp(time)), 1e-300)
    shape = np.stack([along, along**2 - np.mean(along**2)], axis=1)
    none = np.zeros((0, 2))
    return [FreeForm("time", shape * x[:, None], np.zeros(0), none, changes=what) for what, x in series.items()]


def with_load(regression: TorqueRegression) -> list[FreeForm]:
    """The drive's torque, changing with the load before: a motor warms up with the square of its torque, and cools.

    Every run begins cold, and the gain changes about what it is on average, which is the number that the model has.
    """
    torques = regression.ahead("torque")
    mean_square = sum(float(x @ x) for x in torques) / max(sum(map(len, torques)), 1)
    if not mean_square > 0.0:
        return []
    longest = max(map(len, torques))

    def warmed(torque: Array) -> Array:
        heat = []
        for share in WARMING_RUN_SHARES:
            kept = float(np.exp(-1.0 / max(share * longest, 1.0)))
            heat.append(lfilter([1.0 - kept], [1.0, -kept], torque**2 / mean_square))
        return np.stack(heat, axis=1) * torque[:, None]

    passed, torque = regression.along(torques, warmed), regression.series()[3]
    columns = passed - torque[:, None] * (torque @ passed / max(float(torque @ torque), 1e-300))
    return [FreeForm("history", columns, np.zeros(0), np.zeros((0, columns.shape[1])), changes=GAIN)]


def along_angle(regression: TorqueRegression) -> list[FreeForm]:
    """Inertia, damping and dry friction that change with the angle: a crank, an eccentric magnet, a seal.

    A turning inertia that changes with the angle gives the square of the rate besides, by half its slope (Lagrange).
    Each changes about what it is on average where it shows, which is the number that the model has.
    """
    angle, rate, acceleration = regression.series()[:3]
    free, _ = free_splines(angle)
    if free is None:
        return []

    def shape(at: Array) -> Array:
        return np.column_stack([at, free(at)])

    beside = 1e-4 * float(np.ptp(angle))
    slope = (shape(angle + beside) - shape(angle - beside)) / (2.0 * beside)
    here = shape(angle)

    def about(x: Array) -> Array:
        return here - (x**2 @ here) / max(float(x @ x), 1e-300)

    slow = 0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300
    direction = np.tanh(rate / slow)
    terms = {
        "inertia": about(acceleration) * acceleration[:, None] + 0.5 * slope * rate[:, None] ** 2,
        "damping": about(rate) * rate[:, None],
        "friction": about(direction) * direction[:, None],
    }
    none = np.zeros((0, here.shape[1]))
    return [FreeForm("angle", columns, np.zeros(0), none, changes=what) for what, columns in terms.items()]


def pulsating(regression: TorqueRegression, fit: TorqueFit) -> list[FreeForm]:
    """Angle, rate and torque times a wave over the time: a spring, a damping or a gain that something outside changes.

    The frequency is where the residual times the quantity has its highest line; the phase is another in every run.
    """
    angle, rate, _, torque, time, run = regression.series()
    residual = np.concatenate(fit.residuals)
    out = []
    driven = [] if regression.torque_free else [("torque", torque)]
    for on, series in (("angle", angle), ("rate", rate), *driven):
        # A wave times a motion swings with the sum and the difference of their frequencies: one of these may lie in the
        # band where the wave itself does not.
        frequency_hz = _strongest_line_hz(residual * series, time, run, 2.0 * regression.cutoff_hz)
        if frequency_hz is None:
            continue
        wave = regression.with_wave(on, frequency_hz)
        columns = [part * (run == k) for k in np.unique(run) for part in wave.T]
        none = np.zeros((0, len(columns)))
        out.append(FreeForm("time", np.stack(columns, axis=1), np.zeros(0), none, True, on, frequency_hz))
    return out


def _strongest_line_hz(values: Array, time: Array, run: Array, highest_hz: float) -> float | None:
    """The frequency at which the power of all runs' lines is highest; None where no run is long enough for one."""
    step_s = float(np.min(np.diff(time)[np.diff(time) > 0.0], initial=np.inf))
    longest_s = float(np.max(time))
    lowest_hz = MIN_PERIODS / max(longest_s, 1e-300)
    if not np.isfinite(step_s) or lowest_hz >= min(highest_hz, 0.5 / step_s):
        return None
    size = 2 ** int(np.ceil(np.log2(2.0 * longest_s / step_s + 2.0)))  # half a line's width between two frequencies
    power = np.zeros(size // 2 + 1)
    for k in np.unique(run):
        here = run == k
        on_grid = np.bincount(np.rint(time[here] / step_s).astype(int), values[here] - np.mean(values[here]), size)
        power += np.abs(np.fft.rfft(on_grid)) ** 2
    hz = np.fft.rfftfreq(size, step_s)
    power[(hz < lowest_hz) | (hz > highest_hz)] = 0.0
    return float(hz[np.argmax(power)])
