"""Spectral lines in what a model predicts wrongly, and the part of the disturbance that stands at their frequencies.

A torque that the likelihood takes for noise has a smooth spectrum, and so have the innovations of a right model: they
are white. An effect that the library lacks repeats with the motion (a torque sent in coarse steps, a spring that is
shaken, a coupling that slips): its power stands at a few frequencies, which no curve over angle, rate or time shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, percentile_filter
from scipy.signal.windows import hann
from scipy.stats import norm

from identify.diagnose.disturbance import DEPENDENCE_SIGMAS, MIN_POWER_SHARE
from identify.likelihood.fit import Fit
from identify.results import Dependence
from identify.signals.trace import UPSAMPLING
from rig.arrays import Array

FLOOR_BINS = 81  # of a spectrum, whose median is its level without lines
NEAR_BINS, QUIET_SHARE = 21, 0.3  # of it nearest to a bin, and the share of those by which their level is read
LOWEST_BIN = 3  # cycles in a stretch: what turns more slowly is a drift and no line
MIN_LINE_SAMPLES = 4 * FLOOR_BINS  # samples: a shorter stretch shows no line


def lines_left(fit: Fit, torque_nm: float) -> Dependence | None:
    """The part of the disturbance at spectral lines of the innovations; None where it is not worth a word.

    A bin is a line where it stands so far above the median of its neighbours that chance alone brings one in all bins
    together with the probability that any other dependence is held to (``DEPENDENCE_SIGMAS``). The power in a bin of
    white noise is exponentially distributed, and its median is its mean times the logarithm of two. Lines are worth a
    word by their share of the disturbance's power or of what the readings are predicted wrongly by: a vibration that
    the sensor folds back is no torque, and still no noise.

    Parameters
    ----------
    fit
        The final model on the samples that were searched.
    torque_nm
        Root mean square of the torque, N m.
    """
    spectra = list(_spectra(fit))
    count = sum(len(own) for own, _, _ in spectra)
    if not count:
        return None
    false_alarm = float(norm.sf(DEPENDENCE_SIGMAS))
    above = float(np.log(count / false_alarm))
    at_lines, together = np.zeros(2), np.zeros(2)
    for own, disturbance, let_through in spectra:
        is_line = _stands_out(own, above)
        if let_through is not None:
            is_line &= ~_stands_out(let_through, above) & (disturbance > let_through)
        both = np.stack([disturbance, own])
        at_lines += np.sum(both[:, is_line], axis=1)
        together += np.sum(both, axis=1)
    share, of_readings = at_lines / np.maximum(together, 1e-300)
    if max(share, of_readings) < MIN_POWER_SHARE:
        return None
    squares = [np.mean(d[s.weight] ** 2) for d, s in zip(fit.prediction.disturbance_nm, fit.shots, strict=True)]
    rms = float(np.sqrt(share * np.mean(squares)))
    return Dependence("frequency", rms, rms / torque_nm, false_alarm)


def _stands_out(power: Array, above: float) -> NDArray[np.bool_]:
    """Bins that are so many times what their neighbours have in the mean, as white noise would make these.

    Of near ones the quieter third counts, for lines may lie close together. Noise that a sensor has filtered falls off
    within the wider stretch, and where it is dense it is no line.
    """
    near = percentile_filter(power, 100.0 * QUIET_SHARE, NEAR_BINS, mode="reflect") / -np.log1p(-QUIET_SHARE)
    wide = median_filter(power, FLOOR_BINS, mode="reflect") / np.log(2.0)
    return np.asarray(power > above * np.maximum(near, wide))


def _spectra(fit: Fit) -> Iterator[tuple[Array, Array, Array | None]]:
    """Power of innovations, of the disturbance and of a filtered torque in every bin of every stretch that counts.

    The filter of a noisy torque lets that noise through around the frequencies of the torque itself: it is left as a
    disturbance there, and no effect; so is a short burst of it. Nothing stands for a torque that was not filtered.
    """
    p = fit.prediction
    for innovations, variance, torque, shots in zip(
        p.innovations, p.variance, p.disturbance_nm, fit.shots, strict=True
    ):
        scaled = innovations[:, 0] / np.sqrt(variance[:, 0])
        for first, last in _stretches(shots.weight):
            if last - first >= MIN_LINE_SAMPLES:
                trace, here = shots.trace, slice(first, last)
                let_through = _power(trace.fine[3][::UPSAMPLING][here]) if trace.torque_is_filtered else None
                yield _power(scaled[here]), _power(torque[here]), let_through


def _power(values: Array) -> Array:
    window = hann(len(values), sym=False)
    power = np.abs(np.fft.rfft((values - np.mean(values)) * window)) ** 2
    return np.asarray(power[LOWEST_BIN:] / np.sum(window**2))


def _stretches(counts: Array) -> Sequence[tuple[int, int]]:
    """First sample of every stretch that counts, and the one behind its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], counts, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
