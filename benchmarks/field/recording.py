"""Play a rig and measure it: motion in fine steps, then the columns that a user's file would hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks.field import noise
from benchmarks.field.plant import CODES
from benchmarks.field.references import reference
from benchmarks.field.rigs import Rig, Unsuitable
from benchmarks.field.simulation import simulate

PULLS_AT_REST = ("unbalance", "cogging", "torque_offset", "settling_torque")


@dataclass(frozen=True)
class Motion:
    """One run in fine steps of ``step_s`` (n). ``at`` indexes the fine steps at which samples are taken."""

    step_s: float
    before: int  # fine steps before t = 0
    at: Any
    angle: Any  # (n + 1)
    rate: Any  # (n + 1)
    asked: Any  # torque of the drive before its effects, mean over a step (n)
    current: Any  # the same at the instant (n + 1)
    shaft: Any  # torque behind the drive's effects (n)
    disturbance: Any  # (n)

    @property
    def times(self) -> Any:
        """Instants of the samples, s."""
        return (self.at - self.before) * self.step_s

    def sampled(self, x: Any) -> Any:
        """A series of n + 1 values at the samples."""
        return x[self.at]

    def mean(self, x: Any) -> Any:
        """Means of a series of n values between samples, shape (samples - 1,)."""
        return np.add.reduceat(x, self.at[:-1]) / np.diff(self.at)

    def change(self, x: Any) -> Any:
        """Change over the step between samples of the straight line closest to a series of n values (samples - 1,)."""
        span = np.diff(self.at)
        place = np.arange(self.at[0], len(x)) + 0.5 - np.repeat(self.at[:-1] + 0.5 * span, span)
        moment = np.add.reduceat(place * x[self.at[0] :], self.at[:-1] - self.at[0])
        return moment * 12.0 / np.maximum(span**2 - 1, 1)


@dataclass(frozen=True)
class Levels:
    """What the noise is measured by: rms and peak of torque and rate of the motion, and each run's amplitude."""

    torque: float
    torque_peak: float
    rate: float
    rate_peak: float
    gains: tuple[float, ...]  # rad where the loop is closed, N m where it is open


def _rest(rig: Rig, near: float) -> float:
    """Angle at which loads and spring leave the axis at rest, rad."""
    pulls = [(n, v) for n, v in rig.effects.items() if n in PULLS_AT_REST]
    if not pulls or (rig.loop != "open" and not rig.has_spring):
        return near

    def torque(th: float) -> float:
        total = rig.stiffness * th
        for _, v in pulls:
            order = v.get("order", 1.0)
            total += (
                v["level"] if "level" in v else v["sine"] * math.sin(order * th) + v["cosine"] * math.cos(order * th)
            )
        return total

    if not rig.has_spring:
        v = rig.effects.get("unbalance")
        return -math.atan2(v["cosine"], v["sine"]) if v else near
    reach = 1.01 * sum(abs(v.get("level", 0.0)) + abs(v.get("sine", 0.0)) + abs(v.get("cosine", 0.0)) for _, v in pulls)
    reach /= rig.stiffness
    return float(brentq(torque, -reach, reach, xtol=1e-12)) if reach > 0.0 else 0.0


def _start(rig: Rig, rng: noise.Rng) -> float:
    """Angle at which a run begins, rad."""
    if rig.has_spring or rig.sensors == "gyro":
        return 0.0
    return float(rng.uniform(-math.pi, math.pi) if rig.zero_anew else rng.uniform(-0.3, 0.3) * rig.travel_rad)


def play(
    rig: Rig, gains: Sequence[float], disturbance_nm: float, peak_rate: float, seed: Sequence[int]
) -> list[Motion]:
    """Every run of a rig, with a disturbance of a given rms.

    Raises
    ------
    Unsuitable
        Where the rig runs away or needs too fine a step.
    """
    fine = rig.fine_steps(peak_rate)
    h = rig.sample_s / fine
    names, zo, po, p, states = rig.layout()
    codes = np.array([CODES[n] for n in names], dtype=np.int64)
    rubs = bool(np.any(codes // 100 == 1)) if names else False
    delay = rig.effects.get("torque_delay", {}).get("delay", 0.0)
    loop = rig.loop_numbers(2.0 * math.pi / rig.loop_counts)
    settle = (
        8.0 / (2.0 * math.pi * max(rig.loop_hz, 0.4 * rig.own_hz))
        if rig.loop != "open" or rig.has_spring
        else rig.sample_s
    )
    motions = []
    for number, (seconds, shape, gain) in enumerate(zip(rig.seconds, rig.shapes, gains, strict=True)):
        rng = np.random.default_rng([*seed, number, 1])
        asks = np.random.default_rng([*seed, 0 if rig.repeats else number, 2])
        start = _rest(rig, _start(rig, rng))
        before = math.ceil(settle * rig.sample_hz) * fine
        at = before + noise.instants(rng, round(seconds * rig.sample_hz), fine, rig.jitter, rig.wander)
        n = int(at[-1])
        t = (np.arange(n) - before) * h
        wanted, slope = reference(shape, asks, t, rig.low_hz, rig.high_hz)
        offset = start if rig.loop != "open" else 0.0
        acts = np.ones(n, dtype=np.bool_)
        if rig.torque_column == "command":
            acts[:] = False
            acts[:before:fine] = True
            acts[at[at < n]] = True
        slow = disturbance_nm * math.sqrt(rig.slow_share)
        fast = disturbance_nm * math.sqrt(1.0 - rig.slow_share)
        d = noise.relaxing(rng, n, h, slow, rig.slow_s) + noise.relaxing(rng, n, h, fast, 0.5 / math.pi / rig.band_hz)
        out, asked = simulate(
            h, before, np.array([rig.inertia, rig.damping, rig.stiffness]), codes, zo, po, p, delay, loop,
            np.stack([offset + gain * wanted, gain * slope], axis=1), acts, d, start, states, rubs,
        )  # fmt: skip
        if not np.isfinite(out[0, 0]):
            raise Unsuitable("the rig ran away")
        motions.append(Motion(h, before, at, out[:, 0], out[:, 1], asked, out[:, 3], out[:-1, 4], d))
    return motions


def levels(rig: Rig, motions: Sequence[Motion], gains: Sequence[float]) -> Levels:
    """Sizes of torque and rate over all runs."""
    torque = [m.asked[m.before :] for m in motions]
    rate = [m.rate[m.before :] for m in motions]
    return Levels(
        noise.rms_of(torque), max(float(np.abs(x).max()) for x in torque), noise.rms_of(rate),
        max(float(np.abs(x).max()) for x in rate), tuple(gains),
    )  # fmt: skip


@dataclass(frozen=True)
class Measured:
    """One run as recorded: columns by name (with ``valid`` where samples were lost so), all n instants, who arrived."""

    columns: dict[str, Any]
    torque: Any  # the torque column at every instant
    arrived: Any
    channels: dict[str, Any]  # rate or angle at every instant
    stamped_s: Any  # how much later than the instants the stamps of all samples are
    late: Any  # what its lag and low-pass add to the gyro's reading, rad/s


def measure(rig: Rig, motions: Sequence[Motion], size: Levels, seed: Sequence[int]) -> list[Measured]:
    """The columns of every run, with the noise of every sensor."""
    bias = rig.gyro_bias * size.rate
    out = []
    for number, m in enumerate(motions):
        rng = np.random.default_rng([*seed, number, 3])
        n = len(m.at)
        channels: dict[str, Any] = {}
        late = np.zeros(n)
        if rig.sensors != "gyro":
            step = 2.0 * math.pi / rig.counts
            zero = float(np.rint(m.angle[m.at[0]] / step)) if rig.zero_anew else 0.0
            channels["angle_rad"] = step * (np.rint(m.sampled(m.angle) / step) - zero)
        if rig.sensors != "encoder":
            sensed = _sensed(rig, m)
            late = (sensed - m.rate)[m.at]
            channels["rate_rad_s"] = sensed[m.at] + _gyro_noise(rig, m, size, rng) + bias
        torque = _torque(rig, m, size, rng)
        true = m.times - m.times[0]
        stamps = true + rig.stamp_error * rig.sample_s * rng.standard_normal(n)
        stamps = np.maximum.accumulate(stamps)
        stamps += 1e-9 * np.arange(n) * rig.sample_s  # no two samples at one time
        arrived = noise.kept(rng, n, rig.lost, max(3, min(50, n // 100)))
        columns = {"time_s": stamps, "torque_nm": torque, **channels}
        if not arrived.all() and rig.lost_as_rows:
            columns = {k: v[arrived] for k, v in columns.items()}
        elif not arrived.all():
            columns = {k: np.where(arrived, v, 0.0) if k in channels else v for k, v in columns.items()}
            columns["valid"] = arrived.astype(float)
        out.append(Measured(columns, torque, arrived, channels, stamps - true, late))
    return out


def _torque(rig: Rig, m: Motion, size: Levels, rng: noise.Rng) -> Any:
    """The torque column: the command held from the sample on, or the current at the instant with noise and steps."""
    if rig.torque_column == "command":
        held = np.append(m.asked, m.asked[-1])
        return held[m.at]
    step = 2.0 * size.torque_peak / 2**rig.current_bits
    seen = m.sampled(m.current) + rig.current_noise * size.torque * rng.standard_normal(len(m.at))
    return step * np.rint(seen / step)


def _sensed(rig: Rig, m: Motion) -> Any:
    """Rate behind the gyro's lag (where it has one) and low-pass, in fine steps."""
    rate = m.rate
    if "sensor_lag" in rig.effects:
        rate = noise.lagged(rate, math.exp(-m.step_s / rig.effects["sensor_lag"]["time"]))
    return noise.low_pass(rate, m.step_s, rig.gyro_corner_hz)


def _gyro_noise(rig: Rig, m: Motion, size: Levels, rng: noise.Rng) -> Any:
    """White noise behind the low-pass, flicker and a walking bias, at the samples."""
    white = noise.filtered_white(rng, len(m.rate), m.step_s, rig.gyro_noise * size.rate, rig.gyro_corner_hz)[m.at]
    n = len(m.at)
    slow = noise.flicker(rng, n, rig.sample_s, rig.gyro_flicker * size.rate)
    return white + slow + noise.walk(rng, n, rig.sample_s, rig.gyro_walk * size.rate)
