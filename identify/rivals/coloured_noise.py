"""Noise of a sensor that filters what it measures: denser where the platform moves than where noise is read.

The noise of a record is read high in its spectrum, where nothing moves. A gyro that is sampled faster than it passes
has little there, so what is left of a right model seems far above its noise. Noise is told from what a model lacks by
this: between the harmonics of a sine, where nothing answers to it, it is as dense in every run, whatever shook the
platform, and nearly flat wherever the platform moves, with no peak at its resonance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from identify.results import Identification, RunTraces
from identify.signals.noise import LOWER, LOWER_MEAN
from identify.signals.period import torque_period_s
from identify.signals.torque_bandwidth import highest_hz
from identify.wording import frequency, number
from rig.errors import Aborted, RecordingError
from rig.recording.run import Array

TOP = 0.98  # of Nyquist
MIN_BINS = 8  # of an octave
MIN_TORQUE_PERIODS = 8  # of the torque in a run, so that there are bins between its harmonics
HARMONIC_GUARD_BINS = 2.5  # bins from a harmonic, which a window spreads that far
# Of a period, by which another run's has to differ: what answers to a torque is alike under the same one.
MIN_PERIOD_DIFFERENCE = 0.05
SCATTER = 1.52  # of a band's density over the root of its bins, as a share of itself
# Standard errors, and share beyond that, by which two readings of one density may differ.
AGREEMENT_SIGMAS, AGREEMENT_SHARE = 4.0, 0.15
MIN_PASSBAND_RATIO = 0.3  # of the density: what the sensor has to pass still where the platform moves
MIN_ROLL_OFF = 1.5  # times the density at the top
NO_FLOOR = 1e3  # the same, where a model is far off: nothing but a filter leaves so little there
MAX_MOTION_FREQUENCY_RATIO = 1.3  # times the natural frequency or the torque's
MIN_DENSITY_SAMPLES = 512  # samples of a run whose density is read


class Colour(NamedTuple):
    """A sensor's noise that falls off with frequency.

    Attributes
    ----------
    level
        Standard deviation of white noise as dense as this one is where the platform moves, rad/s or rad.
    rms
        Its own root mean square, the same unit.
    flat_to_hz
        How far up it is that dense.
    """

    level: float
    rms: float
    flat_to_hz: float


class _Bands(NamedTuple):
    """Densities of white noise as large (its variance) in octaves from the top down, and bins in each."""

    top_hz: Array
    density: Array
    bins: Array


def with_noise_known(
    found: Identification, again: Callable[[Colour], Identification], say: Callable[[str], None]
) -> Identification:
    """What was found, or what is found with the noise of a sensor that filters what it measures.

    Parameters
    ----------
    found
        With something unexplained.
    again
        Identifies the same recording with its noise known.
    say
        Receives a line before each.
    """
    colour = colour_of(found)
    try:
        if colour is None and (guess := guess_of(found)) is not None:
            say("repeating with coloured noise: the sensor noise may be larger at the frequencies of the motion")
            guessed = again(guess)
            if guessed.aborted:
                return replace(found, aborted=True)
            colour = colour_of(guessed)
        if colour is None:
            return found
        say("repeating with coloured noise: the residual looks like noise that the sensor has filtered")
        known = again(colour)
    except RecordingError:  # too much noise for anything to be seen is none that the record has
        return found
    except (Aborted, KeyboardInterrupt):  # what the first look found is whole, and is not lost with the second
        return replace(found, aborted=True)
    if known.aborted:
        return replace(found, aborted=True)
    return known if known.verdict.unexplained or colour_of(known) is not None else found


def colour_of(found: Identification) -> Colour | None:
    """The colour of the noise that a model leaves, where what it leaves has the marks of noise and is not white.

    Lines are nothing of it: they may stand beside, for the search that is made anew with the noise known.
    """
    seen = _spectrum_of(found)
    if seen is None or not (np.all(_is_common_to_runs(seen)) and np.all(_is_low_passed(seen))):
        return None
    level = float(np.max(seen.pooled[seen.moving]))
    passed = seen.pooled > MIN_PASSBAND_RATIO * level
    if not np.all(passed[seen.moving]) or not np.all(seen.pooled[seen.moving] > MIN_ROLL_OFF * seen.pooled[0]):
        return None
    return Colour(float(np.sqrt(level)), _rms(seen), float(np.max(seen.top_hz[passed])))


def guess_of(found: Identification) -> Colour | None:
    """What the noise may be where a model is far off: as dense as above the platform's motion, if alike in all runs.

    A guess to search with; what it finds has to leave noise by :func:`colour_of`.
    """
    seen = _spectrum_of(found)
    if seen is None:
        return None
    above = ~seen.moving
    level = float(np.max(seen.pooled[above]))
    low_passed = np.all(_is_common_to_runs(seen)[:, above]) and np.all(_is_low_passed(seen)[above[1:]])
    if not low_passed or level < NO_FLOOR * seen.pooled[0]:
        return None
    flat_to_hz = float(np.max(seen.top_hz[seen.pooled > MIN_PASSBAND_RATIO * level]))
    return Colour(float(np.sqrt(level)), _rms(seen._replace(pooled=np.minimum(seen.pooled, level))), flat_to_hz)


class _Spectrum(NamedTuple):
    """Densities of all runs, (runs, octaves) and pooled, (octaves,), and the octaves in which the platform moves."""

    top_hz: Array
    density: Array
    bins: Array
    pooled: Array
    moving: Any


def _spectrum_of(found: Identification) -> _Spectrum | None:
    """None where too little is seen: no two sines, or motion up to where noise was read."""
    platform, periods = found.final.platform, [torque_period_s(t) for t in found.traces]
    runs = [(p, _bands(t, p)) for t, p in zip(found.traces, periods, strict=True) if p is not None]
    each = [r for _, r in runs if r is not None]
    known = [p for p, r in runs if r is not None]
    if platform is None or found.torque_free or not known or max(known) < (1.0 + MIN_PERIOD_DIFFERENCE) * min(known):
        return None
    several = min(len(r.bins) for r in each)
    if several < 2 or any(not np.allclose(r.top_hz[:several], each[0].top_hz[:several], rtol=0.01) for r in each):
        return None
    top_hz = each[0].top_hz[:several]
    density, bins = (np.array([getattr(r, what)[:several] for r in each]) for what in ("density", "bins"))
    pooled = np.sum(density * bins, axis=0) / np.sum(bins, axis=0)
    natural_hz = float(np.sqrt(max(platform.stiffness_nm_rad, 0.0) / platform.inertia_kg_m2)) / (2.0 * np.pi)
    fastest_hz = max(natural_hz, *(_highest_torque_hz(t) for t in found.traces))
    moving = top_hz < 2.0 * MAX_MOTION_FREQUENCY_RATIO * fastest_hz  # the octaves that begin below that
    if not np.any(moving) or np.all(moving) or not np.all(pooled > 0.0):
        return None
    return _Spectrum(top_hz, density, bins, pooled, moving)


def _is_common_to_runs(seen: _Spectrum) -> Any:
    return np.abs(seen.density / seen.pooled - 1.0) < AGREEMENT_SIGMAS * SCATTER / np.sqrt(seen.bins) + AGREEMENT_SHARE


def _is_low_passed(seen: _Spectrum) -> Any:
    """Whether an octave is no denser than the one below it, (octaves - 1,)."""
    chance = SCATTER / np.sqrt(np.sum(seen.bins, axis=0))
    margin = AGREEMENT_SIGMAS * np.hypot(chance[:-1], chance[1:])
    return seen.pooled[:-1] < seen.pooled[1:] * (1.0 + margin + AGREEMENT_SHARE)


def _rms(seen: _Spectrum) -> float:
    widths = np.append(seen.top_hz[:-1] - seen.top_hz[1:], seen.top_hz[-1])  # as dense below the lowest as in it
    return float(np.sqrt(np.sum(seen.pooled * widths) / seen.top_hz[0]))


def describe_colour(colour: Colour | None, axis: str, channel: str) -> str:
    """One sentence on it, empty where there is none.

    Parameters
    ----------
    axis
        "rotary" or "linear".
    channel
        "rate" or "angle".
    """
    if colour is None:
        return ""
    linear = axis == "linear"
    unit = ("m" if linear else "deg") + ("/s" if channel == "rate" else "")
    dense, whole = (
        f"{number(size if linear else math.degrees(size), 3)} {unit}" for size in (colour.level, colour.rms)
    )
    return (
        "What is left is noise, alike in all runs and coloured: flat up to about "
        f"{frequency(round(colour.flat_to_hz))}, where it is that of white noise of {dense} rms, and falling above; "
        f"{whole} rms in all. Effects are judged by the first number, the residual by the second"
    )


def _highest_torque_hz(trace: RunTraces) -> float:
    return 0.0 if trace.torque_nm is None else highest_hz(trace.torque_nm, float(np.median(np.diff(trace.time_s))))


def _bands(trace: RunTraces, period_s: float) -> _Bands | None:
    """Density of the longest stretch of what the final model leaves, between the harmonics of its torque.

    Blind to other lines, as the noise of a record is.
    """
    left = trace.measured - trace.simulated_after
    first, last = _longest((trace.keep > 0.0) & np.isfinite(left))
    n = last - first
    step = float(np.median(np.diff(trace.time_s)))
    if n < MIN_DENSITY_SAMPLES or n * step < MIN_TORQUE_PERIODS * period_s:
        return None
    part, window = left[first:last], np.hanning(n)
    power = np.abs(np.fft.rfft((part - np.mean(part)) * window)) ** 2 / float(np.sum(window**2))
    hertz = np.fft.rfftfreq(n, step)
    between = np.abs(hertz - np.rint(hertz * period_s) / period_s) > HARMONIC_GUARD_BINS / (n * step)
    top = TOP * 0.5 / step
    tops = top * np.exp2(-np.arange(int(np.log2(n))))
    inside = [np.sort(power[between & (hertz > 0.5 * t) & (hertz <= t)]) for t in tops]
    enough = int(np.sum(np.cumprod([len(p) >= MIN_BINS for p in inside])))
    density = [float(np.mean(p[: round(LOWER * len(p))])) / LOWER_MEAN for p in inside[:enough]]
    return _Bands(tops[:enough], np.array(density), np.array([len(p) for p in inside[:enough]]))


def _longest(use: Any) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(use, dtype=int), [0]])))
    return max(
        zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True), key=lambda ab: ab[1] - ab[0], default=(0, 0)
    )
