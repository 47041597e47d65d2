"""Where a torque that nobody recorded may come from a second mass, by its frequency, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal

from identify.signals.trace import UPSAMPLING, Trace
from rig.arrays import Array

MODE_RATIO = 0.03  # damping ratio of the resonators that are looked through; they stand as close as they are wide
MAX_MODES = 3  # frequencies, the strongest
FASTEST = 0.35  # of the sampling rate: beyond, a resonator is hardly seen


def resonances_hz(traces: Sequence[Trace], torques_nm: Sequence[Array]) -> tuple[float, ...]:
    """Frequencies in Hz of the resonators on the shaft that carry most of a torque, the strongest first.

    A lightly damped mode shows within a few percent of its frequency only, so the look is as fine as that. Each
    resonator is driven by the measured acceleration; what inertia, damping, stiffness and a constant torque can carry
    is projected out.

    Parameters
    ----------
    torques_nm
        The torque that nobody recorded, one array (n,) a trace.
    """
    steps = {t.step_s for t in traces}
    longest_s = max(t.step_s * len(t.measured) for t in traces)
    highest, lowest = FASTEST / max(steps), max(0.5, 2.0 / longest_s)
    if highest <= lowest:
        return ()
    hertz = np.geomspace(lowest, highest, 2 + int(np.log(highest / lowest) / np.log1p(MODE_RATIO)))
    power = np.zeros(len(hertz))
    for trace, torque in zip(traces, torques_nm, strict=True):
        power += _carried(trace, torque, hertz)
    peaks = signal.find_peaks(power)[0]
    return tuple(float(hertz[k]) for k in peaks[np.argsort(-power[peaks])][:MAX_MODES])


def _carried(trace: Trace, torque: Array, hertz: Array) -> Array:
    """Power of one run's torque along each resonator's, (f,)."""
    known = np.isfinite(torque)
    moved = _resonators(trace, hertz)
    along = moved @ np.where(trace.keep & known, np.where(known, torque, 0.0), 0.0)
    return np.asarray(along**2)


def _resonators(trace: Trace, hertz: Array) -> Array:
    """What each resonator takes besides what the platform does, of unit power where samples count, (f, n).

    It is the same whatever the torque is, so it is computed once for a run.
    """
    key = ("resonators", len(hertz), float(hertz[0]), float(hertz[-1]))
    return np.asarray(trace.once(key, lambda: _made(trace, hertz)))


def _made(trace: Trace, hertz: Array) -> Array:
    angle, rate = (x[::UPSAMPLING] for x in trace.fine[:2])
    acceleration = np.gradient(rate, trace.step_s)
    platform = np.column_stack([acceleration, rate, angle, np.ones(len(rate))])
    basis = np.linalg.qr(np.where(trace.keep[:, None], platform, 0.0))[0]
    out = np.zeros((len(hertz), len(rate)))
    for row, (b, a) in zip(out, map(_resonator, hertz * trace.step_s), strict=True):
        row[:] = np.where(trace.keep, signal.lfilter(b, a, acceleration), 0.0)
    out -= (out @ basis) @ basis.T
    out[:, ~trace.keep] = 0.0
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def _resonator(cycles: float) -> tuple[Array, Array]:
    """Numerator and denominator of the resonator that rings ``cycles`` times in a sample, (3,) each.

    The bilinear transform of ``(d s + w^2) / (s^2 + d s + w^2)``; ``w`` is warped so that the peak stands there.
    """
    w = np.tan(np.pi * cycles)
    d, square = 2.0 * MODE_RATIO * w, w * w
    size = 1.0 + d + square
    return (
        np.array([d + square, 2.0 * square, square - d]) / size,
        np.array([size, 2.0 * (square - 1.0), 1.0 - d + square]) / size,
    )
