"""Runs whose sensor was noisier than in the others: fitted together, they would pass for something unexplained.

All runs are judged by one noise, the least that they agree on. A run whose noise is as white, only at another level (a
loose plug, a machine next door, another range of the gyro), tells less than the others and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.signals.noise import NOISE_SCATTER, least_of, noise_of
from identify.signals.trace import Trace
from identify.wording import number
from rig.decimation import NOISE_BAND

NOISY_RATIO = 1.2  # times the noise of the other runs: less is fitted with them and hardly shows
NOISY_SIGMAS = 5.0  # standard errors of a reading of the noise: what differs by less is alike
MIN_QUIET_RUNS = 2  # quiet runs without which nobody knows which ones are noisy
MAX_NOISY_SHARE = 0.5  # of the runs


def noisy_runs(traces: Sequence[Trace]) -> list[tuple[Trace, float]]:
    """The runs that are noisier than the others, and by which factor; none where half of the runs or more are."""
    out: list[tuple[Trace, float]] = []
    for channel in ("rate", "angle"):
        mine = [t for t in traces if t.channel == channel]
        quiet = least_of([(t.noise, len(t.measured)) for t in mine])
        if not quiet > 0.0:
            continue
        loud = [(t, t.noise / quiet) for t in mine if _is_louder(t, quiet)]
        if len(mine) - len(loud) >= MIN_QUIET_RUNS and len(loud) < MAX_NOISY_SHARE * len(mine):
            out += [(t, times) for t, times in loud if _is_white(t)]
    return out


def describe_noisy_runs(runs: Sequence[tuple[str, float]]) -> str:
    """What was left out, in words; empty where nothing was."""
    if not runs:
        return ""
    each = ", ".join(f"{name} ({number(times, 2)} times the noise of the other runs)" for name, times in runs)
    return f"Excluded as too noisy: {each}; check the cable and record {'it' if len(runs) == 1 else 'them'} again"


def _is_louder(trace: Trace, quiet: float) -> bool:
    chance = NOISE_SCATTER / float(np.sqrt(len(trace.measured)))
    return trace.noise > quiet * max(NOISY_RATIO, 1.0 + NOISY_SIGMAS * chance)


def _is_white(trace: Trace) -> bool:
    """Whether both halves of the band in which the noise is read hold the same: motion falls off, or rings."""
    first, last = max(trace.stretches, key=lambda ab: ab[1] - ab[0])
    values, middle = trace.measured[first : last + 1], 0.5 * (NOISE_BAND[0] + NOISE_BAND[1])
    low, high = noise_of(values, (NOISE_BAND[0], middle)), noise_of(values, (middle, NOISE_BAND[1]))
    chance = NOISE_SCATTER * float(np.sqrt(2.0 / len(values)))  # of either half
    return abs(low - high) < NOISY_SIGMAS * chance * (low + high) / np.sqrt(2.0)
