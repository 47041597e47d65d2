"""A recording made smaller for a search: sampled no faster than it moves, and the spans of it that tell most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.runs.holdout import Split
from identify.signals.trace import SHORTEST_STRETCH, UPSAMPLING, Trace
from rig.arrays import Array
from rig.decimation import REACH, SAMPLES_A_PERIOD, SPAN_STARTS, keeps_white, sharp

DEFAULT_REDUCED_SAMPLES = 20_000  # samples, where nothing else is asked for
HARMONICS = 5.0  # of a decay's swing: it moves no faster, whatever its noise does
TURNS = 0.02  # of the largest rate, below which a turn may be noise
SHORTEST_SPAN = 1_500  # samples: slow effects need a span to show in
# Acceleration, rate, angle, direction, constant; and where torque, rate and angle reach farthest.
INFORMATION_COLUMNS = 8
# Power that leaves of a quantity little but its peaks: what sets in there (a limit, a stop) shows nowhere else.
OUTERMOST = 5
LEAD = 0.25  # of a span, that is measured ahead of it: ``identify.likelihood.settling`` leaves it out again


def reduced(traces: Sequence[Trace], split: Split, enough: int = DEFAULT_REDUCED_SAMPLES) -> tuple[list[Trace], Split]:
    """The same runs with about ``enough`` samples, and the split of these.

    Every run is first filtered and decimated, all of it; what is still too long is cut to the span in which inertia,
    damping, stiffness and dry friction are best told apart, and where there are many runs, to some of them: those that
    reach farthest, as what limits a drive or a travel shows nowhere else, and others evenly spread between them.
    """
    factor = min(_decimation(t) for t in traces)
    total = sum(t.count for t in traces)
    factor = max(1, min(factor, int(np.ceil(total / enough))))
    few = [decimated(t, factor) for t in traces]
    fit = [_every(m, factor, len(t.measured)) & t.keep for m, t in zip(split.fit, few, strict=True)]
    judge = [_every(m, factor, len(t.measured)) & t.keep for m, t in zip(split.judge, few, strict=True)]
    wanted = max(enough // max(len(few), 1), SHORTEST_SPAN)
    chosen = range(len(few))
    if wanted * len(few) > 1.5 * enough:
        count = max(2, enough // wanted)
        fitting = [i for i in chosen if np.any(fit[i])]
        judging = [i for i in chosen if np.any(judge[i]) and i not in fitting]
        picked = {*_chosen(few, fitting, count), *_chosen(few, judging, max(1, count // 3))}
        chosen = sorted(picked)  # type: ignore[assignment]
    out, fits, judges = [], [], []
    information: Array = 1e-6 * np.eye(INFORMATION_COLUMNS)
    for i in chosen:
        t = few[i]
        first, last, information = _span(t, wanted, information)
        lead = min(first, int(LEAD * wanted))  # in it what is inside the platform settles
        fit[i][:first] = judge[i][:first] = False
        first -= lead
        piece = t if (first, last) == (0, len(t.measured) - 1) else t.piece(first, last)
        if not piece.stretches:
            continue
        out.append(piece)
        fits.append(fit[i][first : last + 1])
        judges.append(judge[i][first : last + 1])
    return out, Split(fits, judges, [t.keep for t in out], split.note)


def thinned(traces: Sequence[Trace], masks: Sequence[Any], most: int) -> tuple[list[Trace], list[Any]]:
    """The whole of all runs, filtered and decimated as far as their motion allows and ``most`` samples ask for."""
    total = sum(t.count for t in traces)
    factor = max(1, min(*(_decimation(t) for t in traces), int(np.ceil(total / most))))
    few = [decimated(t, factor) for t in traces]
    return few, [_every(m, factor, len(t.measured)) & t.keep for m, t in zip(masks, few, strict=True)]


def _chosen(traces: Sequence[Trace], items: Sequence[int], count: int) -> set[int]:
    """So many of some runs: with the largest torque, rate and angle, and evenly spread ones."""
    if len(items) <= count:
        return set(items)
    reach = [[float(np.max(np.abs(x), initial=0.0)) for x in _torque_rate_angle(traces[i])] for i in items]
    farthest = [items[k] for k in dict.fromkeys(np.argmax(reach, axis=0).tolist())][:count]
    others = [i for i in items if i not in farthest]
    even = np.linspace(0, len(others) - 1, count - len(farthest)).astype(int).tolist() if others else []
    return {*farthest, *(others[i] for i in even)}


def _torque_rate_angle(trace: Trace) -> tuple[Array, Array, Array]:
    """Torque, rate and angle from its middle, of a run; no torque in a decay."""
    angle, rate, _, torque, _ = trace.fine
    return np.zeros(1) if trace.torque is None else np.asarray(torque), rate, angle - float(np.median(angle))


def _decimation(trace: Trace) -> int:
    """How many samples may become one: none that the motion needs, nor one that a known filter of the sensor does."""
    if trace.run.rate_corner_hz:
        return 1
    slowest_hz = 1.0 / (SAMPLES_A_PERIOD * trace.step_s)
    return max(1, int(slowest_hz / (trace.cutoff_hz if trace.torque is not None else HARMONICS * _swing_hz(trace))))


def _swing_hz(trace: Trace) -> float:
    """How often a decay swings, by its turns."""
    rate = trace.fine[1][::UPSAMPLING]
    rate = rate[np.abs(rate) > TURNS * np.max(np.abs(rate))]
    return 0.5 * float(np.sum(rate[1:] * rate[:-1] < 0.0)) / (len(trace.measured) * trace.step_s) + 1e-12


def decimated(trace: Trace, factor: int) -> Trace:
    """A trace sampled every so manyth time, low-passed before; its torque stays as it was recorded."""
    if factor <= 1:
        return trace
    order = REACH * factor
    # A gyro's noise has to stay white: a low-pass of the gyro is told by it. Next to an encoder, whose steps are not
    # white in any case, what a driven platform does close to the new Nyquist frequency counts for more.
    by_gyro = trace.channel == "rate" or trace.beside is not None
    weights = keeps_white(factor) if by_gyro or trace.torque is None else sharp(factor)

    def passed(values: Array) -> Array:
        padded = np.pad(values, order, mode="reflect", reflect_type="odd")
        return np.asarray(np.convolve(padded, weights, mode="valid")[::factor])

    measured, less = passed(trace.measured), float(np.sqrt(np.sum(weights**2)))
    keep = _every(trace.keep, factor, len(measured))
    keep[:REACH] = keep[len(measured) - REACH :] = False  # there the filter reaches beyond the run
    stretches = [(-(-a // factor), b // factor) for a, b in trace.stretches]
    stretches = [(a, min(b, len(measured) - 1)) for a, b in stretches if b - a + 1 >= SHORTEST_STRETCH]
    inside = np.zeros(len(measured), dtype=bool)
    for a, b in stretches:
        inside[a : b + 1] = True
    return replace(
        trace, measured=measured, keep=keep & inside, stretches=stretches, step_s=factor * trace.step_s,
        noise=less * trace.noise, beside=None if trace.beside is None else passed(trace.beside),
        beside_noise=less * trace.beside_noise, motion=None, _series={},
        drift_rad=None if trace.drift_rad is None else trace.drift_rad[::factor],
    )  # fmt: skip


def _every(mask: Any, factor: int, count: int) -> Any:
    """Which of every so many samples have all their neighbours."""
    if factor <= 1:
        return mask
    half = factor // 2
    whole = np.convolve(np.pad(~mask, half, constant_values=False).astype(int), np.ones(2 * half + 1, int), "valid")
    return (whole == 0)[::factor][:count]


def _span(trace: Trace, wanted: int, information: Array) -> tuple[int, int, Array]:
    """First and last sample of the span of a length that adds most to what other runs tell, and that with it."""
    n = len(trace.measured)
    angle, rate, time, torque = (np.asarray(x)[::UPSAMPLING] for x in trace.fine[:4])
    acceleration, angle = np.gradient(rate, time), angle - np.mean(angle)
    slow = 0.02 * float(np.max(np.abs(rate))) + 1e-300
    outermost = [(x / (np.max(np.abs(x)) + 1e-300)) ** OUTERMOST for x in (torque, rate, angle)]
    columns = np.stack([acceleration, rate, angle, np.tanh(rate / slow), np.ones(n), *outermost], axis=1)
    columns = columns / (np.sqrt(np.mean(columns**2, axis=0)) + 1e-300)
    columns[~trace.keep] = 0.0

    def with_span(first: int) -> Array:
        part = columns[first : first + wanted]
        return np.asarray(information + part.T @ part / wanted)

    if n <= 1.25 * wanted:
        return 0, n - 1, information + columns.T @ columns / wanted
    places = np.linspace(0, n - wanted, SPAN_STARTS).astype(int).tolist()
    first = max(places, key=lambda at: float(np.linalg.slogdet(with_span(at))[1]))
    return first, first + wanted - 1, with_span(first)
