"""The runs with the torque of the model's effects taken off: what is left obeys J a + C w + K th = M."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.genetic.effect_free import effect_free
from identify.model.parameters import platform_of
from identify.signals.trace import UPSAMPLING, Trace
from rig import effects
from rig.dynamics import Equations, TorqueSignal
from rig.dynamics.low_pass import low_pass_kernel, smoothed
from rig.effects.base import Place


def linear_traces(traces: Sequence[Trace], fitted: FinalFit) -> list[Trace]:
    """The runs with the torque that is left for J a + C w + K th once the model's effects are taken off."""
    if not fitted.structure.effects:
        left = list(traces)
    elif fitted.free_run is None or not fitted.sensor_limited:
        left = [_along_measured(t, fitted) for t in traces]
    else:
        left = [effect_free(t, s, fitted.free_run) for t, s in zip(traces, fitted.free_run.shots, strict=True)]
    values = np.array(list(fitted.values.values()))
    sensor = Equations(platform_of(fitted.structure, tuple(fitted.values), values)).sensor
    return [_as_the_gyro_sees(t, sensor) for t in left]


def _as_the_gyro_sees(trace: Trace, sensor: Any) -> Trace:
    """The torque behind the same filters as the rate: for a linear platform that changes nothing else."""
    low_pass = trace.low_pass
    if trace.channel != "rate" or trace.torque is None or not (low_pass or sensor.names):
        return trace
    fine = trace.step_s / UPSAMPLING
    n = (len(trace.measured) - 1) * UPSAMPLING + 1
    mean = np.asarray(sensor.apply(trace.torque.on_half_steps(trace.start_s, fine, n), fine))
    if low_pass is not None:
        mean = smoothed(mean, low_pass_kernel(*low_pass, fine))
    time = trace.start_s + fine * np.arange(n)
    return replace(trace, torque=TorqueSignal(time, mean, "zero_order"), _series={})


def _along_measured(trace: Trace, fitted: FinalFit) -> Trace:
    """A run less its effects' torque along the measured motion, as means over each upsampled step."""
    n = (len(trace.measured) - 1) * UPSAMPLING
    drive = []
    extra = np.zeros(n + 1)
    for name in fitted.structure.effects:
        effect = effects.get(name)
        given = [fitted.values.get((name, p.name), fitted.values.get((name, p.name, str(trace.number)), 0.0))
                 for p in effect.parameters]  # fmt: skip
        if effect.place is Place.DRIVE:
            drive.append((name, tuple(given)))
            continue
        shape = tuple(v for v, p in zip(given, effect.parameters, strict=True) if not p.linear)
        units = [(i, v) for i, (v, p) in enumerate(zip(given, effect.parameters, strict=True)) if p.linear]
        units += [({"inertia": -3, "damping": -2, "stiffness": -1}[t], fitted.values[(t,)]) for t in effect.leans_on]
        for unit, value in units:
            pieces = trace.effect_pieces(effect, shape, unit)
            if pieces is not None:
                extra[:-1] += value * pieces[:, 0]
                extra[-1] += value * pieces[-1, 0]
    torque = trace.torque_pieces((("torque_delay", (0.0,)), *drive))
    assert torque is not None
    applied = np.append(torque[0][:, 0], torque[0][-1, 0])[: n + 1]
    left = applied - extra
    mean = np.append(0.5 * (left[1:] + left[:-1]), left[-1])
    time = trace.start_s + trace.step_s / UPSAMPLING * np.arange(n + 1)
    return replace(trace, torque=TorqueSignal(time, mean, "zero_order"), _series={})
