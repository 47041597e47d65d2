"""A run made ready for the fit: laid on an even grid, its noise, its gaps and its usable stretches found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy import signal

from identify.signals.channel_readings import lost
from identify.signals.glitches import glitches
from identify.signals.noise import bandwidth_of, least_of, noise_of, rounding_of
from identify.signals.resampling import MAX_SPACING_PERIODS, beat_of, sampled, torque_instants
from identify.signals.trace import SHORTEST_STRETCH, UPSAMPLING, Trace, _gaps, drop_samples_at_seam
from rig.dynamics import TorqueSignal
from rig.recording.run import Array, Run

LEAD_IN_S = 0.01  # at the start of a run that carry no weight
LONGEST_FILL = 25  # missing samples that a spline may bridge
# Coherence with the differenced encoder above which a rate was made from it (16 segments show a sixteenth by chance),
# in bins of which at least this many hold no more than so many times the encoder's noise.
REPEATED, FEW_BINS, MAX_NOISE_POWER_RATIO = 0.3, 8, 2.0


@dataclass(frozen=True)
class Channels:
    """What is read of all runs alike: the channel that is predicted, and whether the other one is read beside it."""

    first: Literal["rate", "angle"]
    both: bool = False


def channels_of(runs: Sequence[Run]) -> Channels:
    """The channel that every run has and that tells more where the motion is; both where they are independent."""
    if any(r.rate_rad_s is None for r in runs):
        return Channels("angle")
    if any(r.angle_rad is None for r in runs):
        return Channels("rate")
    better = float(np.mean([_rate_over_angle(r) for r in runs]))
    coherent = [c for r in runs if (c := _noise_in_common(r)) is not None]
    alone = any(r.rate_corner_hz for r in runs)
    return Channels("rate" if better < 0.0 else "angle", not alone and min(coherent, default=1.0) < REPEATED)


def _rate_over_angle(run: Run) -> float:
    """Logarithm of the rate's noise over the angle's as a rate, where 99 % of the motion is."""
    assert run.rate_rad_s is not None and run.angle_rad is not None
    step = float(np.median(np.diff(run.time_s)))
    ok = run.valid & np.isfinite(run.rate_rad_s) & np.isfinite(run.angle_rad)
    f, power = signal.welch(run.rate_rad_s[ok], 1.0 / step, nperseg=min(int(ok.sum()), 4096), detrend="constant")
    moving_rad_s = 2.0 * np.pi * f[np.searchsorted(np.cumsum(power), 0.99 * np.sum(power))]
    as_rate = noise_of(run.angle_rad[ok]) * moving_rad_s
    return float(np.log(max(noise_of(run.rate_rad_s[ok]), 1e-300) / max(as_rate, 1e-300)))


def _noise_in_common(run: Run) -> float | None:
    """Coherence of the rate with the differenced encoder where the encoder's own noise is most of it.

    A rate that was differenced from the encoder repeats its noise, whatever filter is between them; a gyro does not.
    None where the motion stands above the encoder's noise everywhere.
    """
    assert run.rate_rad_s is not None and run.angle_rad is not None
    ok = run.valid & np.isfinite(run.rate_rad_s) & np.isfinite(run.angle_rad)
    step = float(np.median(np.diff(run.time_s)))
    angle, rate = run.angle_rad[ok], run.rate_rad_s[ok]
    differenced = np.diff(angle, prepend=angle[0]) / step
    length = min(256, len(angle) // 16)
    if length < 16:
        return None
    f, power = signal.welch(differenced, nperseg=length)
    noise = max(noise_of(angle), rounding_of(angle) or 0.0)
    of_noise = 2.0 * (noise * 2.0 * np.sin(np.pi * f) / step) ** 2
    with np.errstate(all="ignore"):
        _, alike = signal.coherence(rate, differenced, nperseg=length)
    blind = np.isfinite(alike) & (power < MAX_NOISE_POWER_RATIO * of_noise) & (f > 0.05) & (f < 0.48)
    return float(np.mean(alike[blind])) if np.sum(blind) >= FEW_BINS else None


def bias_beside(run: Run, time: Array, values: Array, good: Any) -> float:
    """What a gyro reads at rest, in rad/s: how fast its angle runs away from that of an encoder beside it.

    Between holes in the record only: what was turned there the gyro has not seen.
    """
    assert run.angle_rad is not None
    both = good & np.isfinite(run.angle_rad)
    t, rate = time[both], values[both]
    spacing = np.diff(t)
    ahead = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * spacing)]) - run.angle_rad[both]
    upper = lower = 0.0
    for piece in np.split(np.arange(len(t)), 1 + np.flatnonzero(spacing > MAX_SPACING_PERIODS * np.median(spacing))):
        x = t[piece] - np.mean(t[piece])
        upper, lower = upper + float(x @ ahead[piece]), lower + float(x @ x)
    return upper / lower if lower > 0.0 else 0.0


def _noise_beside(run: Run, channel: Literal["rate", "angle"], whole: Array) -> float:
    """Standard deviation of the channel that was not chosen; an encoder's at least that of its steps."""
    values = run.angle_rad if channel == "rate" else run.rate_rad_s
    assert values is not None
    return max(noise_of(whole), rounding_of(values[run.valid & np.isfinite(values)]) or 0.0)


def prepare(
    run: Run, number: int = 0, noise: float | None = None, lead_in_s: float = LEAD_IN_S,
    full_scale: tuple[float, float] = (-np.inf, np.inf), channels: Channels | None = None,
) -> Trace:  # fmt: skip
    """Lay a run on a uniform grid and find its usable stretches.

    Parameters
    ----------
    number
        Which run of the recording it is.
    noise
        One standard deviation of the measured channel; estimated where None.
    lead_in_s
        Samples at the start that carry no weight.
    full_scale
        The lowest and highest rate that the gyro can report: at these it may have turned faster.
    channels
        What is read of all runs; the best of this run alone where None.
    """
    channels = channels or channels_of([run])
    channel = channels.first
    values = run.rate_rad_s if channel == "rate" else run.angle_rad
    assert values is not None
    good = run.valid & np.isfinite(values) & ~lost(run)
    beyond = good & ((values <= full_scale[0]) | (values >= full_scale[1]))
    if channel == "angle":
        beyond[:] = False
    clipped = int(beyond.sum()), float(np.max(np.abs(values[beyond]), initial=0.0))
    good &= ~beyond
    time = run.time_s - run.time_s[0]
    if channel == "rate" and run.angle_rad is not None:
        values = values - bias_beside(run, time, values, good)
    laid = sampled(beat_of(run.name, time), time, values, good)
    step, n, grid, filled, keep = laid.beat.step_s, laid.beat.count, laid.beat.instants, laid.values, laid.there
    gaps = _gaps(keep)
    broken = np.zeros(n, dtype=bool)
    for first, last in gaps:
        if last - first + 1 > LONGEST_FILL:
            broken[first : last + 1] = True
    filled = np.where(broken, np.interp(grid, time[good], values[good]), filled)  # a spline would swing through a gap
    broken[np.clip(np.rint((time[beyond] - grid[0]) / step).astype(int), 0, n - 1)] = True  # no spline knows that peak
    broken |= (grid < time[good][0] - 0.5 * step) | (grid > time[good][-1] + 0.5 * step)
    quiet = max(_gaps(broken), key=lambda ab: ab[1] - ab[0])  # a jump over a gap would pass for noise
    torn = glitches(filled, keep & ~broken, noise)
    if np.any(torn):
        filled = np.where(torn, np.interp(grid, grid[~torn], filled[~torn]), filled)
        keep &= ~torn
    whole = filled[quiet[0] : quiet[1] + 1]
    other = (run.angle_rad if channel == "rate" else run.rate_rad_s) if channels.both else None
    beside = None
    if other is not None:
        there = good & np.isfinite(other)
        beside = sampled(laid.beat, time, np.where(there, other, 0.0), there).values
    torque = None
    if run.torque_nm is not None and run.torque_time_s is not None:
        torque = TorqueSignal(torque_instants(run.torque_time_s, run.time_s, laid), run.torque_nm, run.torque_hold)
    trace = Trace(
        run, channel, step, filled, keep, [], torque, noise if noise is not None else noise_of(whole),
        bandwidth_of(whole, step), number, laid.beat.offset_s, float(run.time_s[0]) + grid[torn],
        clipped, (laid.scatter_s, laid.stamps_wrong), beside=beside,
        beside_noise=0.0 if beside is None else _noise_beside(run, channel, beside[quiet[0] : quiet[1] + 1]),
    )  # fmt: skip
    if run.min_rate_rad_s > 0.0:
        slow = np.abs(trace.fine[1][::UPSAMPLING]) <= run.min_rate_rad_s
        broken |= slow
        del trace.fine  # its angle is put right in every stretch
    first = int(np.ceil(lead_in_s / step))
    if torque is not None and first > 0 and n > 100 * first:
        # A delay reaches back to torque from before the record began, which nobody knows; what it did
        # to the motion is part of the start state once these samples are past.
        broken[:first] = True
    trace.keep = keep & ~broken
    trace.stretches = [(a, b) for a, b in _gaps(broken) if b - a + 1 >= SHORTEST_STRETCH]
    inside = np.zeros(n, dtype=bool)
    for a, b in trace.stretches:
        inside[a : b + 1] = True
    trace.keep &= inside
    for seam in (0, *(a for a, _ in trace.stretches), n):
        drop_samples_at_seam(trace, seam, trace.keep)
    return trace


def one_noise(traces: Sequence[Trace], known: bool) -> list[Trace]:
    """All runs were measured by one sensor; the quietest runs show its noise with the least of the motion in it."""
    traces, quietest = traces if known else above_steps(traces), {}
    for channel in ("rate", "angle"):
        found = [(t.noise, len(t.measured)) for t in traces if t.channel == channel]
        quietest[channel] = min(found, default=(0.0, 0))[0] if known else least_of(found)
    several = all(t.beside is not None for t in traces)
    beside = least_of([(t.beside_noise, len(t.measured)) for t in traces]) if several else 0.0
    return [
        replace(t, noise=quietest[t.channel], beside=t.beside if several else None, beside_noise=beside) for t in traces
    ]


def above_steps(traces: Sequence[Trace]) -> list[Trace]:
    """The runs with no less noise than the steps make, in which one sensor reads: a run of few steps tells none."""
    roundings: dict[str, list[float]] = {"rate": [], "angle": []}
    for t in traces:
        values = t.run.rate_rad_s if t.channel == "rate" else t.run.angle_rad
        assert values is not None
        rounding = rounding_of(values[t.run.valid & np.isfinite(values)])
        if rounding is not None:
            roundings[t.channel].append(rounding)
    return [replace(t, noise=max(t.noise, min(roundings[t.channel], default=0.0))) for t in traces]
