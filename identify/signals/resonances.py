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
    angle, rate = (x[::UPSAMPLING] for x in trace.fine[:2])
    acceleration = np.gradient(rate, trace.step_s)
    keep = trace.keep & np.isfinite(torque)
    if np.sum(keep) < 8:
        return np.zeros(len(hertz))
    basis = np.linalg.qr(np.column_stack([acceleration, rate, angle, np.ones(len(rate))])[keep])[0]
    rest = torque[keep] - basis @ (basis.T @ torque[keep])
    out = np.zeros(len(hertz))
    for k, f in enumerate(hertz):
        w = 2.0 * np.pi * f
        warped = 2.0 / trace.step_s * np.tan(0.5 * w * trace.step_s)  # so that the peak stands at this frequency
        b, a = signal.bilinear(
            [2.0 * MODE_RATIO * warped, warped**2], [1.0, 2.0 * MODE_RATIO * warped, warped**2], 1.0 / trace.step_s
        )
        moved = signal.lfilter(b, a, acceleration)[keep]
        moved = moved - basis @ (basis.T @ moved)
        out[k] = float(moved @ rest) ** 2 / max(float(moved @ moved), 1e-300)
    return out
