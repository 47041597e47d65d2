"""One look at all rows of a long recording: its beat, its mean, and how far up its motion stands above the noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rig.arrays import Array
from rig.decimation import NOISE_BAND
from rig.recording.long.laying import Laying, Uneven

PERIODOGRAM_SAMPLES = 8192  # samples of a periodogram
FEWEST_SEGMENTS = 4
ABOVE = 12.0  # times the floor from where on a frequency counts as motion, and
BANDWIDTH_RATIO = 1.5  # times the highest of them is the bandwidth: as the search takes them from a whole run


@dataclass(frozen=True)
class Scan:
    """What the rows are like.

    Attributes
    ----------
    step_s
        Spacing of the samples.
    even
        Whether they lie on a beat, holes of up to a second included.
    bandwidth_hz
        Up to where the motion stands above the noise; the Nyquist frequency where that cannot be told.
    mean
        Of the measured channel.
    """

    step_s: float
    even: bool
    bandwidth_hz: float
    mean: float


def scan(blocks: Iterable[Mapping[str, Array]], channel: str) -> Scan:
    """Look at every block ("time", "valid" and the measured ``channel``) once."""
    laying: Laying | None = None
    total, count, step_s = 0.0, 0, 1.0
    power: Array | None = None
    segments, even = 0, True
    for block in blocks:
        good = block["valid"].astype(bool)
        total, count = total + float(np.sum(block[channel][good])), count + int(np.sum(good))
        if laying is None:
            step_s = float(np.median(np.diff(block["time"]))) if len(block["time"]) > 1 else 1.0
            laying = Laying(step_s)
        if not even:
            continue
        try:
            laid = laying.lay({"time": block["time"], "valid": block["valid"], channel: block[channel]})
        except Uneven:
            even = False
            continue
        several = _periodograms(laid[channel])
        if several is not None:
            power = several.sum(axis=0) if power is None else power + several.sum(axis=0)
            segments += len(several)
    mean = total / max(count, 1)
    if laying is None or not even:
        return Scan(step_s, False, 0.5 / step_s, mean)
    step_s = (laying.last_s - (laying.first_s or 0.0)) / max(laying.count - 1, 1)
    nyquist_hz = 0.5 / step_s
    if power is None or segments < FEWEST_SEGMENTS:
        return Scan(step_s, True, nyquist_hz, mean)
    of_nyquist = np.arange(len(power)) / (len(power) - 1)
    floor = float(np.median(power[(of_nyquist > NOISE_BAND[0]) & (of_nyquist < NOISE_BAND[1])]))
    above = np.flatnonzero(power > ABOVE * floor)
    highest = of_nyquist[above[-1]] if len(above) else 0.05
    return Scan(
        step_s, True, float(np.clip(BANDWIDTH_RATIO * highest, 2.0 / PERIODOGRAM_SAMPLES, 0.8)) * nyquist_hz, mean
    )


def _periodograms(values: Array) -> Array | None:
    """Of the whole segments in a block, shape (segments, frequencies)."""
    rows = len(values) // PERIODOGRAM_SAMPLES
    if not rows:
        return None
    parts = values[: rows * PERIODOGRAM_SAMPLES].reshape(rows, PERIODOGRAM_SAMPLES)
    window = np.hanning(PERIODOGRAM_SAMPLES)
    return np.asarray(np.abs(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window, axis=1)) ** 2)
