"""The zero-phase low-pass that torque and motion pass alike, and what is slow of the difference of two channels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from rig.recording.run import Array

LOW_PASS_ORDER = 2  # of the Butterworth filter; run forwards and backwards it is of the fourth order
EDGE_PERIODS = 3.0  # of the cut-off: so much at either end of a run the filter has not settled
# Of the cut-off, set by hand: over a longer gap a torque that steps moves what nothing stands in for.
GAP_PERIODS = 0.1
DRIFT_PERIODS = 10.0  # of the motion, at least, in which it averages out of two channels' difference; set by hand


@lru_cache(maxsize=64)
def _sections(wn: float) -> Array:
    """Of the filter, (1, 6), at a cut-off over Nyquist's: a search asks hundreds of times for a few of them."""
    return np.asarray(signal.butter(LOW_PASS_ORDER, wn, output="sos"))


def settled(keep: NDArray[Any], step_s: float, cutoff_hz: float | None) -> NDArray[np.bool_]:
    """Samples of a run that count and at which the low-pass has settled, (n,): not at its ends, nor beside a gap.

    Where samples are missing for longer than a tenth of the cut-off's period, what stands in for the motion is none,
    and the torque went on. Of a run so short, or so full of gaps, that this would be most of it, more stays: the middle
    half, and what lies beside gaps. All samples that count where there is no low-pass.

    Parameters
    ----------
    keep
        Shape (n,): samples that count (true, or above zero).
    """
    out = np.asarray(keep) > 0.0
    if not cutoff_hz:
        return out
    period = 1.0 / (cutoff_hz * step_s)
    reach = int(np.ceil(EDGE_PERIODS * period))
    edges = np.diff(np.concatenate([[0], (~out).astype(np.int8), [0]]))
    beside = np.zeros(len(out), dtype=bool)
    for first, behind in zip(np.nonzero(edges == 1)[0].tolist(), np.nonzero(edges == -1)[0].tolist(), strict=True):
        if behind - first > GAP_PERIODS * period:
            beside[max(0, first - reach) : behind + reach] = True
    end = min(reach, len(out) // 4)
    out[:end] = out[len(out) - end :] = False
    clear = out & ~beside
    return clear if 2 * np.sum(clear) >= np.sum(out) else out


def low_pass(values: Array, cutoff_hz: float, step_s: float) -> Array:
    """Zero-phase Butterworth, run forwards and backwards, of twice ``LOW_PASS_ORDER``."""
    wn = 2.0 * cutoff_hz * step_s
    if wn >= 0.95:
        return values
    return np.asarray(signal.sosfiltfilt(_sections(wn), values, padlen=min(len(values) - 1, int(6.0 / wn) + 10)))


def drift_between(
    encoder_rad: Array, angle_rad: Array, rate_rad_s: Array, step_s: float, stretches: Sequence[tuple[int, int]],
    noise_rad: float,
) -> Array:  # fmt: skip
    """By how much an encoder reads more than a gyro's integral, as far as that is slow, (n,).

    A line through the means of blocks of every stretch, and straight on over gaps. The blocks are as long as what is
    left shows no more than the encoder's noise in the means of their halves.

    Parameters
    ----------
    rate_rad_s
        What was integrated, (n,).
    stretches
        First and last sample of each, in order; the whole run where there are none.
    noise_rad
        Of the encoder, one standard deviation.
    """
    period_s = 2.0 * np.pi * float(np.std(encoder_rad)) / max(float(np.std(rate_rad_s)), 1e-300)
    shortest = max(1, int(min(DRIFT_PERIODS * period_s / step_s, len(encoder_rad))))
    more, at, level = encoder_rad - angle_rad, [], []
    for first, last in stretches or [(0, len(more) - 1)]:
        own, blocks = more[first : last + 1], 1
        while True:
            centres, means = _means(own, blocks)
            line = np.interp(np.arange(len(own)), centres, means)
            halves = _means(own - line, 2 * blocks)[1]
            if np.sqrt(np.mean(halves**2)) <= noise_rad or len(own) < 2 * blocks * shortest:
                break
            blocks *= 2
        at += [np.array([first]), first + centres, np.array([last])]
        level += [means[:1], means, means[-1:]]
    return np.interp(np.arange(len(more)), np.concatenate(at), np.concatenate(level))


def _means(values: Array, blocks: int) -> tuple[Array, Array]:
    """The middle of every block, and the mean there."""
    parts = np.array_split(np.arange(len(values)), blocks)
    return np.array([float(np.mean(p)) for p in parts]), np.array([float(np.mean(values[p])) for p in parts])
