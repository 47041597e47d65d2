"""The recorded torque without what only its own measurement added: noise of a current sensor moves no platform.

Prediction error takes the recorded torque for the one that acts. Noise in it has no answer in the readings, and the
likelihood, which looks at fast changes most, then takes the inertia for more than it is, and the gain that such noise
seems to cost at high frequencies for the low-pass of a sensor (errors in variables: Soderstrom 2007). So the torque
is cut into short overlapping pieces, and of the spectrum of each is kept what stands above the noise: a step of the
torque keeps its edge, and the quiet time beside it loses its noise. What is kept so is a pilot, whose power says how
much of every place is torque and how much noise (empirical Wiener filter: Ghael, Sayeed and Baraniuk 1997). Whether
that was noise or acted, the likelihood decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import signal
from scipy.ndimage import uniform_filter

from identify.signals.trace import Trace
from rig.arrays import Array
from rig.dynamics import TorqueSignal

# Samples of a piece, beside the whole run as one: that length is taken with which a run's torque is found in fewest
# places (best basis: Coifman and Wickerhauser 1992). A tone wants long ones, a step short ones.
PIECES_SAMPLES = (32, 64, 128, 256, 512, 1024)
OVERLAP_SHARE = 0.75  # of a piece, with the one after it
FLOOR_START_SHARE = 0.7  # of the Nyquist frequency: above it stands the floor
MIN_NOISE_RATIO = 1e-4  # of the torque: less noise is none
SURELY = 4.0  # times the noise's power, that the pilot has to have in the mean of a few neighbours
WHOLE_RUN_BINS = 13  # of the spectrum of a whole run, over which it is averaged
NEIGHBOURS = 1  # in frequency and in time to either side, over which power is averaged: a single one is too uncertain


def quieter(traces: Sequence[Trace]) -> tuple[list[Trace], float] | None:
    """The same runs with a filtered torque, and how large its noise was, N m rms; None where it shows none.

    A commanded torque that is held from sample to sample is known without noise.
    """
    torques = [t.torque for t in traces]
    if any(t.torque_is_filtered for t in traces):
        return None
    known = [q for q in torques if q is not None and q.hold != "zero_order"]
    values = [q.torque_nm for q in known if len(q.torque_nm) >= 2 * PIECES_SAMPLES[0]]
    if len(values) < len(torques):
        return None
    noise_nm = float(np.median([_noise_nm(v) for v in values]))  # of one sensor, whatever the runs were
    if noise_nm <= MIN_NOISE_RATIO * float(np.sqrt(np.mean(np.concatenate(values) ** 2))):
        return None
    quiet = [
        replace(
            t, torque=TorqueSignal(t.torque.time_s, _without_noise(t.torque.torque_nm, noise_nm), t.torque.hold),
            torque_is_filtered=True, motion=None, _series={},
        )
        for t in traces if t.torque is not None
    ]  # fmt: skip
    return quiet, noise_nm


def _noise_nm(values: Array) -> float:
    """White noise that a torque, (n,), has at its highest frequencies in most pieces, root mean square."""
    pieces = _Pieces(values, PIECES_SAMPLES[1] if len(values) >= 4 * PIECES_SAMPLES[1] else PIECES_SAMPLES[0])
    power = pieces.power[round(FLOOR_START_SHARE * len(pieces.power)) : -1]
    return float(np.sqrt(np.median(power) / np.log(2.0) / pieces.of_unit_noise))  # the median of an exponential


def _without_noise(values: Array, noise_nm: float) -> Array:
    """A torque, (n,), with every part of the spectrum of every piece weighed by how much of it is no noise."""
    ways: list[_Pieces | _WholeRun] = [_Pieces(values, m) for m in PIECES_SAMPLES if 2 * m <= len(values)]
    return min((*ways, _WholeRun(values)), key=lambda way: way.spread(noise_nm)).without(noise_nm)


class _WholeRun:
    """The spectrum of a signal, (n,), as one piece, mirrored at both ends, its power averaged over near frequencies."""

    def __init__(self, values: Array) -> None:
        n = len(values)
        whole = np.concatenate([2.0 * values[0] - values[:0:-1], values, 2.0 * values[-1] - values[-2::-1]])
        self._spectrum, self._samples = np.fft.rfft(whole), len(whole)
        self._near = uniform_filter(np.abs(self._spectrum) ** 2 / len(whole), WHOLE_RUN_BINS, mode="reflect")
        self._middle = slice(n - 1, 2 * n - 1)

    def spread(self, noise_nm: float) -> float:
        """As that of pieces."""
        return float(np.mean(np.minimum(self._near / noise_nm**2, SURELY)))

    def without(self, noise_nm: float) -> Array:
        """The signal without what is not surely above the noise, (n,)."""
        weight = np.maximum(1.0 - SURELY / np.maximum(self._near / noise_nm**2, SURELY), 0.0)
        return np.asarray(np.fft.irfft(weight * self._spectrum, self._samples)[self._middle])


class _Pieces:
    """A signal, (n,), in overlapping pieces, mirrored at both ends so that nothing jumps where it begins and ends.

    Attributes
    ----------
    spectra, power
        Of every piece, (frequencies, pieces).
    of_unit_noise
        Power there of white noise with a variance of one.
    """

    def __init__(self, values: Array, samples: int) -> None:
        self._count, self.samples = len(values), samples
        before, after = values[samples:0:-1], values[-2 : -samples - 2 : -1]
        whole = np.concatenate([2.0 * values[0] - before, values, 2.0 * values[-1] - after])
        window = signal.get_window("hann", samples)
        self._overlap = round(OVERLAP_SHARE * samples)
        self.spectra = signal.stft(whole, nperseg=samples, noverlap=self._overlap)[2]
        self.power = np.abs(self.spectra) ** 2
        self.of_unit_noise = float(np.sum(window**2) / np.sum(window) ** 2)

    def spread(self, noise_nm: float) -> float:
        """In how many places the signal is found: the mean of its power over the noise's, what is surely none alike."""
        return float(np.mean(np.minimum(self._ratio(noise_nm), SURELY)))

    def without(self, noise_nm: float) -> Array:
        """The signal weighed by how much of every place a pilot has, which has nothing but what is surely no noise."""
        surely = np.maximum(1.0 - SURELY / np.maximum(self._ratio(noise_nm), SURELY), 0.0)
        pilot = _Pieces(self._weighed(surely), self.samples)
        return self._weighed(pilot.power / (pilot.power + noise_nm**2 * self.of_unit_noise))

    def _weighed(self, weight: Array) -> Array:
        """The signal with every place weighed, (n,)."""
        weight = weight.copy()
        weight[0] = 1.0  # what stays is no noise
        whole = signal.istft(weight * self.spectra, nperseg=self.samples, noverlap=self._overlap)[1]
        return np.asarray(whole[self.samples : self.samples + self._count])

    def _ratio(self, noise_nm: float) -> Array:
        near = uniform_filter(self.power, 2 * NEIGHBOURS + 1, mode="nearest")
        return np.asarray(near / (noise_nm**2 * self.of_unit_noise))
