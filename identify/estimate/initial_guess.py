"""A first idea of the platform from the data alone, and the scales that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.estimate.regression import Regression, RegressionFit, fit, normal, solve
from identify.model.structure import Shapes, Structure
from identify.signals.prefilter import Denominator
from identify.signals.trace import Trace, pooled_noise
from rig.effects.base import Scale

RHO_STEPS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)  # of the largest rho that the sensor's noise allows
NOISE_SHARE = 0.001  # of the torque: where noise in the torque residual reaches it, the low-pass cuts off


@dataclass(frozen=True)
class Start:
    """A first idea of the platform, from the data alone, and what scales follow from it."""

    platform: tuple[float, float, float]
    rho: float  # the largest sensible one
    cutoff_hz: float  # of the torque residual


def first_guess(traces: Sequence[Trace], structure: Structure) -> Start:
    """J, C, K from a low-passed equation error; nothing declared enters.

    The cut-off is where noise of the measured channel, carried into torque, reaches a small share of the
    torque itself; a tenth of the sample rate at most.
    """
    trace = traces[0]
    rate = trace.channel == "rate"
    highest = 0.1 / trace.step_s
    moving = max(2.0, min(highest, *(t.cutoff_hz for t in traces)))
    w = 2.0 * np.pi * moving
    regression = Regression(traces, structure)
    blocks = regression.blocks(Denominator(1.0, 1.4 * w, w * w), {})
    equations = normal(blocks)
    x = solve(equations.a, equations.b)
    found = dict(zip(regression.labels, x, strict=True))
    inertia = 1.0 if regression.torque_free else abs(float(found.get(("inertia",), 1.0)))
    platform = (inertia, float(found.get(("damping",), 0.0)), float(found.get(("stiffness",), 0.0)))
    size = _torque_size(traces, inertia)
    noise = pooled_noise(traces)
    cutoff = highest
    for f in np.geomspace(highest, 0.01 * highest, 60):
        w, share = 2.0 * np.pi * f, np.sqrt(2.0 * f * trace.step_s)
        carried = inertia * w * noise * share / np.sqrt(3.0) if rate else inertia * w * w * noise * share / np.sqrt(5.0)
        cutoff = float(f)
        if carried <= NOISE_SHARE * size:
            break
    w = 2.0 * np.pi * cutoff
    return Start(platform, inertia * w if rate else inertia * w * w, cutoff)


def _torque_size(traces: Sequence[Trace], inertia: float) -> float:
    squares = []
    for t in traces:
        _angle, rate, time, torque, _ = t.fine
        x = torque if t.torque is not None else inertia * np.gradient(rate, time)
        squares.append(float(np.mean(x**2)))
    return float(np.sqrt(np.mean(squares)))


def best_rho(
    traces: Sequence[Trace], structure: Structure, shapes: Shapes, start: Start, use: Sequence[Any] | None = None
) -> RegressionFit:
    """The solution at the ratio of torque disturbance to sensor noise that predicts best."""
    regression = Regression(traces, structure)
    platform = start.platform
    solutions = []
    for step in reversed(RHO_STEPS):  # from the safest filter to the sharpest
        solution = fit(regression, shapes, platform, step * start.rho, use=use)
        solutions.append(solution)
        platform = solution.jck
    return min(solutions, key=lambda s: s.cost)


def scale_of(
    traces: Sequence[Trace],
    platform: tuple[float, float, float],
    lines_hz: tuple[float, ...],
    ringing_hz: float = 0.0,
    rings_hz: tuple[float, ...] = (),
) -> Scale:
    """How large the motion is."""
    fine = [t.fine for t in traces]
    j, _, k = platform
    return Scale(
        angle_rad=max(float(np.max(np.abs(f[0]))) for f in fine),
        rate_rad_s=max(float(np.max(np.abs(f[1]))) for f in fine),
        torque_nm=max(*(float(np.max(np.abs(f[3]))) for f in fine), 1e-12),
        duration_s=max(t.step_s * len(t.measured) for t in traces),
        step_s=traces[0].step_s,
        natural_frequency_hz=float(np.sqrt(max(k, 1e-12) / max(j, 1e-12)) / (2.0 * np.pi)),
        excitation_hz=tuple(t.run.frequency_hz for t in traces if t.run.frequency_hz),
        lines_hz=lines_hz,
        ringing_hz=ringing_hz,
        rings_hz=rings_hz,
    )
