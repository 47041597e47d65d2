"""From samples at their time stamps to samples on an even beat.

Devices sample evenly; stamps scatter, because whoever wrote them was busy, or samples do, because whoever asked for
them was. The record tells which: a sample that was taken early is moved to its beat along the motion, and the noise is
then no higher than that of an even record. Where moving them raises it, the stamps were wrong and the samples even.
Interpolating between the samples would average their noise, by more the farther they lie from the beat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline, make_interp_spline

from identify.signals.noise import bandwidth_of, noise_of
from rig.errors import RecordingError
from rig.recording.run import Array

BEAT_TOLERANCE = 0.02  # of a period: samples so close to the beat are on it
MAX_BEAT_SCATTER = 0.9  # of a period: stamps that scatter by more have no beat
MAX_SPACING_PERIODS = 1.9  # periods between two samples beyond which one is missing
WANDERING = 0.3  # of a period: spacings that scatter by more belong to no beat, however slow its wander
MAX_SAMPLE_DISTANCE = 1.5  # periods: instants that lie no farther from samples on both sides are read off a spline
MAX_MISSING_RATIO = 20  # times as many missing samples as there are
RETIMING_PASSES = 4  # each along the motion that the one before made out
MOTION_BAND = 0.5  # of the Nyquist frequency: motion above it is not followed when samples are moved
LOWPASS_CUTOFF_RATIO = 2.0  # times the highest frequency above the noise: the low-pass must leave the motion as it is
FOLLOWED_FILTER_ORDER = 3  # Butterworth, run forwards and backwards, as that of ``trace``
MIN_BEAT_SAMPLES = 64  # samples that tell nothing about their noise


@dataclass(frozen=True)
class Beat:
    """Instants ``offset_s + step_s * k``, and the k of every sample, shape (n,).

    ``scattered`` where every sample has an instant of its own that it was taken beside.
    """

    step_s: float
    offset_s: float
    index: Any
    scattered: bool = False

    @property
    def count(self) -> int:
        """Instants from the first sample to the last."""
        return int(self.index[-1]) + 1

    @property
    def instants(self) -> Array:
        """All of them, in s, shape (count,)."""
        return np.asarray(self.offset_s + self.step_s * np.arange(self.count))


@dataclass(frozen=True)
class Sampled:
    """A channel on its beat.

    Attributes
    ----------
    values
        Shape (count,), what is missing bridged by a spline.
    there
        Shape (count,): whether a good sample belongs to the instant.
    scatter_s
        How far stamps lie from the beat, root mean square.
    stamps_wrong
        Whether the samples were even all the same.
    """

    beat: Beat
    values: Array
    there: Any
    scatter_s: float
    stamps_wrong: bool


def beat_of(name: str, time_s: Array) -> Beat:
    """The beat of time stamps that begin at zero, shape (n,); the median spacing where they have none.

    Raises
    ------
    RecordingError
        Where far more samples are missing than there are.
    """
    spacing = np.diff(time_s)
    step = float(np.median(spacing))
    index = np.rint(time_s / step).astype(np.int64)
    if int(index[-1]) + 1 > MAX_MISSING_RATIO * len(time_s):
        widest = int(np.argmax(spacing))
        raise RecordingError(
            f"{name}: {len(time_s)} samples {step:.3g} s apart span {time_s[-1]:.6g} s, with a gap of "
            f"{spacing[widest]:.6g} s after {time_s[widest]:.6g} s: split it into two runs with from_s and to_s"
        )
    if np.max(np.abs(time_s / step - index)) < BEAT_TOLERANCE * min(1.0, step / 1e-9):
        return Beat(float(time_s[-1] / index[-1]), 0.0, index)
    beat = _scattered(time_s, step)
    if beat is None:  # stamps of a software loop that wander: samples lie anywhere, and none is missing but in holes
        near = spacing[spacing < MAX_SPACING_PERIODS * step]
        step = float(np.mean(near)) if np.std(near) < WANDERING * step else step
        beat = Beat(step, 0.0, np.rint(time_s / step).astype(np.int64))
    return beat


def _scattered(time_s: Array, step: float) -> Beat | None:
    """A beat that the stamps scatter about; None where they do not."""
    counted = np.arange(len(time_s))
    period, offset = np.polyfit(counted, time_s, 1)
    if np.max(np.abs(time_s - offset - period * counted)) < MAX_BEAT_SCATTER * period:
        return Beat(float(period), float(offset), counted, scattered=True)
    # Some are missing. A median spacing is too rough to count to the end by; a part of the record makes it finer.
    period, offset, known = step, 0.0, MIN_BEAT_SAMPLES
    while True:
        counted = np.rint((time_s - offset) / period).astype(np.int64)
        if known >= 2 * len(time_s):
            break
        period, offset = np.polyfit(counted[:known], time_s[:known], 1)
        known *= 2
    if np.any(np.diff(counted) < 1):
        return None
    return Beat(float(period), float(offset + period * counted[0]), counted - counted[0], scattered=True)


def sampled(beat: Beat, time_s: Array, values: Array, good: Any) -> Sampled:
    """A channel, shape (n,), laid on its beat.

    Parameters
    ----------
    good
        Shape (n,): samples that are valid.
    """
    grid, late_s = beat.instants, time_s - beat.offset_s - beat.step_s * beat.index
    there = np.zeros(beat.count, dtype=bool)
    near = good & (beat.scattered | (np.abs(late_s) < 0.5 * beat.step_s))
    there[beat.index[near]] = True
    if not beat.scattered and np.any(np.abs(late_s) > BEAT_TOLERANCE * beat.step_s):
        there |= _beside(grid, time_s[good], MAX_SAMPLE_DISTANCE * beat.step_s)
    scatter_s = float(np.sqrt(np.mean(late_s[near] ** 2))) if np.any(near) else 0.0
    splined = np.asarray(CubicSpline(time_s[good], values[good])(grid), dtype=float)
    if not beat.scattered or np.sum(near) < MIN_BEAT_SAMPLES:
        return Sampled(beat, splined, there, scatter_s, False)
    on = beat.index[near]
    even = np.where(there, 0.0, splined)
    even[on] = values[near]
    moved = even.copy()
    for _ in range(RETIMING_PASSES):
        motion = _followed(moved, beat.step_s, bandwidth_of(moved, beat.step_s))
        moved[on] = values[near] - (motion(time_s[near] - beat.offset_s) - motion(beat.step_s * on))
    wrong = noise_of(even) < noise_of(moved)
    return Sampled(beat, even if wrong else moved, there, scatter_s, wrong)


def _beside(grid: Array, time_s: Array, reach_s: float) -> Any:
    """Instants with a sample on either side, no farther than that, (count,)."""
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    return (np.abs(time_s[after] - grid) < reach_s) & (np.abs(grid - time_s[after - 1]) < reach_s)


def torque_instants(torque_time_s: Array, time_s: Array, laid: Sampled) -> Array:
    """When the torque was what it is recorded to be: on the beat, where its rows are those of samples wrongly stamped.

    ``time_s`` are the stamps of the samples; a torque with stamps of its own keeps them.
    """
    if not laid.stamps_wrong:
        return torque_time_s
    row = np.minimum(np.searchsorted(time_s, torque_time_s), len(time_s) - 1)
    if np.any(time_s[row] != torque_time_s):
        return torque_time_s
    return np.asarray(time_s[0] + laid.beat.instants[laid.beat.index[row]])


def _followed(values: Array, step_s: float, cutoff_hz: float) -> Any:
    """The motion in a channel, as a function of the time since its first instant."""
    wn = min(2.0 * LOWPASS_CUTOFF_RATIO * cutoff_hz * step_s, MOTION_BAND)
    sos = signal.butter(FOLLOWED_FILTER_ORDER, wn, output="sos")
    slow = signal.sosfiltfilt(sos, values, padlen=min(len(values) - 1, int(10.0 / wn)))
    return make_interp_spline(step_s * np.arange(len(values)), slow, k=5)


def describe(runs: Sequence[tuple[str, float, bool]]) -> str:
    """One sentence on stamps that scatter: (name, by how much in s, whether the stamps are wrong); empty for none."""
    wrong = [(name, scatter_s) for name, scatter_s, is_wrong in runs if is_wrong]
    if not wrong:
        return ""
    which = ", ".join(name for name, _ in wrong)
    most = max(scatter_s for _, scatter_s in wrong)
    return (
        f"Time stamps of {which} have a jitter of up to {1e6 * most:.3g} us rms, but the motion shows that the samples "
        "are evenly spaced: even spacing is assumed"
    )
