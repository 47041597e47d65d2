"""Single samples that stand apart while their neighbours agree: a spike on the line, a cut-off last sample.

A corner of the rate, where dry friction reverses, stands out of its neighbours as well, but it comes with every
swing. A glitch is rare and far larger than what the run does elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.recording.run import Array
from rig.recording.turns import MEDIAN_SIGMAS

MAX_GLITCHES = 8  # in one run; more of them are something that the platform or its surroundings do
GLITCH_SIGMAS = 30.0  # times the noise
GLITCH_STEP_RATIO = 4.0  # times the largest of what the run does more often
INSIDE = np.array([1.0, -6.0, 15.0, 0.0, 15.0, -6.0, 1.0]) / 20.0  # a quintic through three neighbours on each side
ENDS = np.array([4.0, -6.0, 4.0, -1.0])  # a cubic through the four before, the latest first
ENDS_SPREAD = 8.4  # times as much noise in what the cubic foretells
STEEPEST = 7.0  # times a glitch beside the end moves what the cubic foretells


def glitches(values: Array, usable: Any, noise: float | None = None) -> Any:
    """Which samples are glitches, (n,) boolean.

    Parameters
    ----------
    values
        Shape (n,): an evenly sampled channel.
    usable
        Shape (n,): samples that count; one that does not is never a glitch, nor may a neighbour be judged by it.
    noise
        One standard deviation of the channel's white noise; from the median fourth difference where None, which a
        few glitches do not move.
    """
    n = len(values)
    out = np.zeros(n, dtype=bool)
    if n < 50:
        return out
    values = np.array(values)
    if noise is None:
        noise = float(np.median(np.abs(np.diff(values, 4)))) / (MEDIAN_SIGMAS * np.sqrt(70.0))
    ends = _torn_end(values, usable, noise), _torn_end(values[::-1], usable[::-1], noise)
    for torn, end, beside in ((ends[0], n - 1, values[-5:-1]), (ends[1], 0, values[4:0:-1])):
        if torn:
            out[end], values[end] = True, ENDS[::-1] @ beside
    sound = np.convolve(usable, np.ones(7), mode="valid") > 6.5
    apart = _apart(values)
    apart[3:-3] *= sound
    peaks, usual = _highest(apart)
    limit = max(GLITCH_SIGMAS * noise, GLITCH_STEP_RATIO * usual)
    out[[p for p in peaks if apart[p] > limit]] = True
    return out


def _apart(values: Array) -> Array:
    """How far each sample lies from what its neighbours on both sides foretell, (n,)."""
    out = np.zeros(len(values))
    out[3:-3] = np.abs(values[3:-3] - np.convolve(values, INSIDE, mode="valid"))
    return out


def _torn_end(values: Array, usable: Any, noise: float) -> bool:
    """Whether the last sample stands apart from those before it, and none of them is what stands apart."""
    ahead = np.abs(values[4:] - np.convolve(values[:-1], ENDS, mode="valid"))
    limit = max(ENDS_SPREAD * GLITCH_SIGMAS * noise, GLITCH_STEP_RATIO * _highest(ahead[:-1])[1])
    return bool(np.all(usable[-5:]) and ahead[-1] > max(limit, STEEPEST * np.max(_apart(values[-12:]))))


def _highest(apart: Array) -> tuple[list[int], float]:
    """Where a few samples stand out most, and how far the next one does; each shows in some beside it."""
    left, peaks = apart.copy(), []
    for _ in range(MAX_GLITCHES):
        peaks.append(int(np.argmax(left)))
        left[max(0, peaks[-1] - 5) : peaks[-1] + 6] = 0.0
    return peaks, float(np.max(left))


def describe(runs: Sequence[tuple[str, Array]]) -> str:
    """One sentence on the glitches of all runs (name, times in s); empty where there are none."""
    found = [(name, times) for name, times in runs if len(times)]
    if not found:
        return ""
    where = "; ".join(f"{name} at {', '.join(f'{t:.4g}' for t in times)} s" for name, times in found)
    count = sum(len(times) for _, times in found)
    each, are = ("1 sample deviates", "is") if count == 1 else (f"{count} samples deviate", "are")
    return (
        f"{each} by more than {GLITCH_SIGMAS:g} times the noise from consistent neighbours and {are} excluded: {where}"
    )
