"""The residual in torque: what the equation of motion leaves over on the measured motion (Eq. 10).

Angle, rate and acceleration come from the measured channel, low-passed by one zero-phase filter; the torque
and the torque of every effect, signs included, pass through the same filter. With a gyro alone, start
angle and rate bias are unknown: a constant and a ramp are fitted to each run's residual.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.results import RunTraces
from identify.signals.low_pass import low_pass, settled
from identify.signals.trace import UPSAMPLING, Trace
from rig import effects
from rig.effects.base import Place
from rig.recording.run import Array

DEPENDENCE_BINS = 30  # of a quantity, in which the residual is averaged
MIN_BIN_SAMPLES = 20  # samples in a bin
WANDER_DEGREE = 5  # of the polynomial in time that the integral of a gyro's bias is taken for


def lags_of(names: Sequence[str]) -> list[str]:
    """Low-passes of the sensor among effects.

    They have no torque, but a gyro that has one shows all of the motion behind it, and the equation of motion holds
    there for the torque behind the same low-pass. (The torque of an effect along that motion is nearly what the
    low-pass makes of it.)
    """
    return [n for n in names if effects.get(n).lag is not None]


def motion(trace: Trace, cutoff_hz: float) -> tuple[Array, Array, Array]:
    """Low-passed angle, rate and acceleration at the samples, each of shape (n,).

    Quintic splines differentiate and integrate: at 29 Hz and 1 kHz even the second derivative of an encoder's
    angle is right to 1e-4, where a cubic one is off by 0.3 %. An angle that is integrated from the rate begins at zero;
    where an encoder reads it, too, that is the angle, as late as the gyro shows the rate.
    """
    t = trace.step_s * np.arange(len(trace.measured))
    spline = make_interp_spline(t, low_pass(trace.measured, cutoff_hz, trace.step_s), k=5)
    if trace.channel == "rate":
        rate, acceleration = np.asarray(spline(t)), np.asarray(spline.derivative()(t))
        integrated = np.asarray(spline.antiderivative()(t))
        if trace.beside is not None:
            angle = low_pass(trace.beside, cutoff_hz, trace.step_s)
            return angle - _gyro_delay_s(angle - integrated, rate, trace.keep) * rate, rate, acceleration
        return trace.put_right(integrated, t), rate, acceleration
    return np.asarray(spline(t)), np.asarray(spline.derivative()(t)), np.asarray(spline.derivative(2)(t))


def _gyro_delay_s(ahead_rad: Array, rate: Array, keep: Any) -> float:
    """By how much a gyro's low-pass makes it late, from how far the encoder is ahead of the integrated rate.

    The integral of the gyro's bias, which wanders slowly, is taken for a polynomial of the time.
    """
    wander = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, len(rate)), WANDER_DEGREE)
    keep = np.asarray(keep, dtype=bool)
    columns = np.column_stack([rate / (np.max(np.abs(rate)) + 1e-300), wander])[keep]
    return float(np.linalg.lstsq(columns, ahead_rad[keep], rcond=None)[0][0] / (np.max(np.abs(rate)) + 1e-300))


@dataclass(frozen=True)
class TorqueResidual:
    """Residual and torque of one run behind the low-pass, N m, shape (n,)."""

    residual: Array
    torque: Array


def torque_residual(
    trace: Trace, structure: Structure, values: Mapping[Name, float], cutoff_hz: float
) -> TorqueResidual | None:
    """M - J a - C w - K th - effects; None for a run without torque."""
    if trace.torque is None:
        return None
    angle, rate, acceleration = motion(trace, cutoff_hz)
    drive: list[tuple[str, tuple[float, ...]]] = []
    lags: list[tuple[str, tuple[float, ...]]] = []
    model = (
        (values.get(("inertia",), 0.0) + trace.run.added_inertia_kg_m2) * acceleration
        + values.get(("damping",), 0.0) * rate
        + values.get(("stiffness",), 0.0) * angle
    )
    extra = np.zeros_like(angle)
    for name in structure.effects:
        effect = effects.get(name)
        given = [_value(values, name, p.name, trace.number) for p in effect.parameters]
        if effect.place is Place.DRIVE:
            drive.append((name, tuple(given)))
            continue
        if effect.place is Place.SENSOR:
            lags += [(n, tuple(given)) for n in lags_of([name]) if trace.channel == "rate"]
            continue
        shape = tuple(v for v, p in zip(given, effect.parameters, strict=True) if not p.linear)
        for i, (v, p) in enumerate(zip(given, effect.parameters, strict=True)):
            if p.linear:
                extra += v * at_samples(trace.effect_pieces(effect, shape, i), len(angle))
        for term in effect.leans_on:
            unit = {"inertia": -3, "damping": -2, "stiffness": -1}[term]
            pieces = trace.effect_pieces(effect, shape, unit)
            extra += values.get((term,), 0.0) * at_samples(pieces, len(angle))
    asked = trace.torque_pieces((*drive, *lags))
    assert asked is not None
    applied = at_samples(asked[0], len(angle), asked[1])
    torque = low_pass(applied, cutoff_hz, trace.step_s)
    residual = torque - model - low_pass(extra, cutoff_hz, trace.step_s)
    if trace.biased:
        t = trace.step_s * np.arange(len(angle))
        clear = settled(trace.keep, trace.step_s, cutoff_hz)
        for first, last in trace.stretches:  # behind a gap the angle begins anew
            here = slice(first, last + 1)
            nuisance = np.column_stack([np.ones(last + 1 - first), t[here]])
            keep = clear[here] if np.sum(clear[here]) > len(nuisance) // 2 else trace.keep[here]
            fitted = np.linalg.lstsq(nuisance[keep], residual[here][keep], rcond=None)[0]
            residual[here] -= nuisance @ fitted
    return TorqueResidual(residual, torque)


def _value(values: Mapping[Name, float], effect: str, parameter: str, run: int) -> float:
    return values.get((effect, parameter), values.get((effect, parameter, str(run)), 0.0))


def at_samples(pieces: Array | None, n: int, upsampling: int = UPSAMPLING) -> Array:
    """A piecewise polynomial at the sample instants, shape (n,)."""
    if pieces is None:
        return np.zeros(n)
    values = pieces[:, 0]
    if pieces.shape[1] == 1:  # held: the mean over a sample around each instant, or a delay seems up to twice as long
        whole = np.concatenate([[0.0], np.cumsum(values)])
        edges = np.clip(upsampling * (np.arange(n + 1) - 0.5), 0.0, len(values))
        mean = np.diff(np.interp(edges, np.arange(len(whole)), whole)) / np.maximum(np.diff(edges), 1e-9)
        return np.where(np.diff(edges) > 0.0, mean, values[-1])
    at = values[::upsampling]
    return np.append(at, np.full(n - len(at), at[-1]))[:n]


def relative(parts: Sequence[TorqueResidual | None], masks: Sequence[Any]) -> tuple[float, float] | None:
    """Root mean square of the residual, and its norm over that of the torque; None without samples."""
    pairs = [(p.residual[m], p.torque[m]) for p, m in zip(parts, masks, strict=True) if p is not None]
    if not pairs or not any(len(r) for r, _ in pairs):
        return None
    residual = np.concatenate([r for r, _ in pairs])
    torque = np.concatenate([t for _, t in pairs])
    return float(np.sqrt(np.mean(residual**2))), float(
        np.linalg.norm(residual) / max(float(np.linalg.norm(torque)), 1e-300)
    )


def torque_noise_floor(
    traces: Sequence[Trace], values: Mapping[Name, float], cutoff_hz: float, masks: Sequence[Any]
) -> float:
    """What sensor noise alone leaves in the torque residual, root mean square, from simulated noise."""
    rng = np.random.default_rng(1)
    squares, count = 0.0, 0
    for trace, mask in zip(traces, masks, strict=True):
        if trace.torque is None or not np.any(mask):
            continue
        noise = _noise_only(trace, rng)
        part = torque_residual(noise, Structure(), values, cutoff_hz)
        assert part is not None
        squares += float(np.sum((part.residual - part.torque)[mask] ** 2))
        count += int(np.sum(mask))
    return float(np.sqrt(squares / count)) if count else float("nan")


def _noise_only(trace: Trace, rng: np.random.Generator) -> Trace:
    from dataclasses import replace  # noqa: PLC0415

    still = None if trace.torque is None else replace(trace.torque, torque_nm=np.zeros_like(trace.torque.torque_nm))
    noise = trace.noise * rng.standard_normal(len(trace.measured))
    return replace(trace, measured=noise, torque=still, drift_rad=None, motion=None, _series={})


def dependence(traces: Sequence[RunTraces], cutoff_hz: float) -> dict[str, float]:
    """What the final residual goes with: share of its power that is a function of each quantity, largest first.

    ``rate``, ``angle`` and ``torque`` are cut into bins, ``time`` into stretches of a run; the power of the bins'
    means, less what their scatter alone would make, is the share. ``time`` counts how the residual's size grows or
    falls over a run; its mean wanders with an integrated gyro anyway, and counts for an encoder alone. Runs without
    torque are judged by measured less simulated.
    """
    left, known = [], []
    for trace in traces:
        y = trace.torque_residual_after
        values = trace.measured - trace.simulated_after if y is None else np.asarray(y)
        time = trace.time_s - trace.time_s[0]
        step_s = float(time[-1]) / max(len(time) - 1, 1)
        use = settled(trace.keep, step_s, None if y is None else cutoff_hz) & np.isfinite(values)
        left.append(np.where(use, values, 0.0))
        known.append(use)
    use = np.concatenate(known) if known else np.zeros(0, dtype=bool)
    if int(np.sum(use)) < MIN_BIN_SAMPLES * DEPENDENCE_BINS:
        return {}
    y = np.concatenate(left)[use]

    def joined(of: str) -> Array:
        return np.concatenate([np.asarray(getattr(t, of)) for t in traces])[use]

    shares = {"rate": _share(joined("rate_rad_s"), y), "angle": _share(joined("angle_rad"), y)}
    if all(t.torque_nm is not None for t in traces):
        shares["torque"] = _share(joined("torque_nm"), y)
    through = np.concatenate([np.linspace(0.0, 1.0, len(t.time_s)) + 2.0 * i for i, t in enumerate(traces)])[use]
    grown = float(abs(np.corrcoef(through % 2.0, np.abs(y))[0, 1])) if np.ptp(y) > 0.0 else 0.0
    absolute = all(t.channel == "angle" for t in traces)
    shares["time"] = max(_share(through, y) if absolute else 0.0, grown**2)
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _share(x: Array, y: Array) -> float:
    """Share of the mean square of y, (n,), that its mean over bins of x explains; scatter taken off."""
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, DEPENDENCE_BINS + 1)))
    if len(edges) < 3 or not np.mean(y * y) > 0.0:
        return 0.0
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(at, minlength=len(edges) - 1), 1)
    mean = np.bincount(at, y, minlength=len(edges) - 1) / count
    square = float(np.mean(y * y))
    explained = float(np.sum(count * mean * mean)) / len(y)
    chance = (square - explained) * len(count) / len(y)
    return float(np.clip((explained - chance) / square, 0.0, 1.0))
