"""What repeats with the excitation at multiples of its frequency that it does not play: no linear model makes them."""

from __future__ import annotations

import numpy as np

from identify.diagnose.harmonics import ORDERS, PLAYED
from identify.diagnose.terms.free_form import FreeForm
from identify.diagnose.torque_regression import TorqueRegression
from identify.signals.period import period_of
from identify.signals.trace import Trace

MIN_PERIODS_PLAYED = 3  # in a run: of fewer, what repeats cannot be told from what happens once


def repeating(regression: TorqueRegression) -> list[FreeForm]:
    """Sines at the multiples of every run's excitation that it does not play; nothing where no torque repeats."""
    time, run = regression.series()[4], regression.run_of_each
    columns = []
    for k, trace in enumerate(regression.traces):
        for hz in _unplayed_hz(trace, regression.cutoff_hz):
            wave = np.exp(2j * np.pi * hz * time) * (run == k)
            columns += [wave.real, wave.imag]
    if not columns:
        return []
    return [FreeForm("frequency", np.stack(columns, axis=1), np.zeros(0), np.zeros((0, len(columns))), True)]


def _unplayed_hz(trace: Trace, highest_hz: float) -> list[float]:
    """Multiples of the frequency at which a run's torque repeats that are no part of that torque."""
    if trace.torque is None:
        return []
    torque = np.asarray(trace.fine[3])
    step_s = float(trace.fine[2][1] - trace.fine[2][0])
    period_s = 1.0 / trace.run.frequency_hz if trace.run.frequency_hz else period_of(torque, step_s)
    periods = int(len(torque) * step_s / period_s) if period_s else 0
    if period_s is None or periods < MIN_PERIODS_PLAYED:
        return []
    whole = torque[len(torque) - round(periods * period_s / step_s) :]
    time = step_s * np.arange(len(whole))
    power = float(np.mean((whole - np.mean(whole)) ** 2))
    out = []
    for multiple in range(2, ORDERS + 1):
        hz = multiple / period_s
        size = abs(np.mean(whole * np.exp(-2j * np.pi * hz * time)))
        if hz < highest_hz and 2.0 * size**2 < PLAYED * power:
            out.append(hz)
    return out
