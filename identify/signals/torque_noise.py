"""The recorded torque without what only its own measurement added: noise of a current sensor moves no platform.

Prediction error takes the recorded torque for the one that acts. Noise in it, above the band of the motion, has no
answer in the readings, and the likelihood, which looks at fast changes most, then takes the inertia for many times what
it is (errors in variables: Soderstrom 2007). A torque whose spectrum ends in a flat floor is passed through a low-pass
that leaves what stands above the floor. Whether that floor was noise or acted, the likelihood decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import signal

from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal

TORQUE_SEGMENT_SAMPLES = 1024  # samples of a stretch whose spectrum is averaged
FLOOR_START_SHARE = 0.7  # of the Nyquist frequency: above it stands the floor
SIGNAL_POWER_RATIO = 8.0  # times the floor's power: a torque that is no noise
CUTOFF_RATIO = 1.5  # times the highest frequency of such a torque: above it there is none
MAX_FLOOR_START_SHARE = 0.6  # of the Nyquist frequency: a floor that begins higher is no matter
MIN_NOISE_RATIO = 1e-4  # of the torque: less noise is none
DENSITY_SMOOTHING_BINS = 6  # of the spectrum to either side over which it is averaged
SURELY = 3.0  # times the floor, below which a part counts as noise


def quieter(traces: Sequence[Trace]) -> tuple[list[Trace], float] | None:
    """The same runs with a filtered torque, and the frequency above which it is noise; None where it has no such floor.

    A commanded torque that is held from sample to sample is known without noise.
    """
    highest, nyquist = 0.0, np.inf
    floors: list[float] = []
    for t in traces:
        if t.torque is None or t.torque.hold == "zero_order" or len(t.torque.torque_nm) < TORQUE_SEGMENT_SAMPLES // 4:
            return None
        half = 0.5 / t.torque.shortest_s
        values = t.torque.torque_nm
        f, power = signal.welch(values, fs=2.0 * half, nperseg=min(len(values), TORQUE_SEGMENT_SAMPLES))
        floor = float(np.median(power[f > FLOOR_START_SHARE * half]))
        if np.sqrt(floor * half) < MIN_NOISE_RATIO * float(np.std(values)):
            return None
        floors.append(floor)
        over = f[power > SIGNAL_POWER_RATIO * floor]
        highest, nyquist = max(highest, float(over[-1]) if len(over) else 0.0), min(nyquist, half)
    cutoff_hz = CUTOFF_RATIO * highest
    if not 0.0 < cutoff_hz < MAX_FLOOR_START_SHARE * nyquist:
        return None
    pairs = zip(traces, floors, strict=True)
    quiet = ((t, _without_noise(t.torque, q)) for t, q in pairs)
    return [replace(t, torque=q, torque_is_filtered=True, motion=None, _series={}) for t, q in quiet], cutoff_hz


def _without_noise(torque: TorqueSignal | None, floor: float) -> TorqueSignal:
    """A torque with every part of its spectrum weighed by how much of it is no noise (Wiener 1949).

    ``floor`` is the density of the noise, N^2 m^2 / Hz, one-sided. The run is mirrored at both ends, so that nothing
    jumps where it begins and ends.
    """
    assert torque is not None
    values = torque.torque_nm
    n = len(values)
    whole = np.concatenate([2.0 * values[0] - values[:0:-1], values, 2.0 * values[-1] - values[-2::-1]])
    spectrum = np.fft.rfft(whole)
    density = 2.0 * np.abs(spectrum) ** 2 * torque.shortest_s / len(whole)
    width = 2 * DENSITY_SMOOTHING_BINS + 1
    smooth = np.convolve(np.pad(density, DENSITY_SMOOTHING_BINS, mode="reflect"), np.ones(width) / width, "valid")
    weight = np.maximum(1.0 - SURELY * floor / np.maximum(smooth, 1e-300), 0.0)
    quiet = np.fft.irfft(weight * spectrum, len(whole))[n - 1 : 2 * n - 1]
    return TorqueSignal(torque.time_s, quiet, torque.hold)
