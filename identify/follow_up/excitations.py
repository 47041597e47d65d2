"""The excitations that a follow-up may choose from: what each is good for, and how much torque the limits leave it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from identify.follow_up.separation import Sensor
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.excitation import Chirp, ExcitationSet, FreeDecay, Multisine, PlannedSet, RampHoldRelease, Sine
from rig.platform import Platform
from rig.preflight import Peaks, predict
from rig.recording.run import Array

AMPLITUDES = (1.0, 0.3, 0.1, 0.03)  # of what the limits allow
MIN_SET_S, MAX_SET_S = 5.0, 15.0  # of a set
SET_PERIODS = 100.0  # of the platform's own oscillation in a set
DRIFT_SET_S = 40.0  # a set long enough for what drifts
MAX_SINE_FREQUENCY_SHARE = 0.08  # of the sample rate: beyond, what happens between the samples is part of the answer
# Frequency over the resonance, and what it is called; set by hand: slow enough for what creeps, up to the resonance.
TONES = (
    (0.017, "a slow sine"),
    (0.1, "a slow sine"),
    (0.31, "a sine"),
    (0.7, "a sine"),
    (0.95, "a sine near resonance"),
)
# The same above the resonance, where the inertia takes the torque; set by hand.
HIGH_TONES = ((1.6, "a sine above resonance"), (2.5, "a sine above resonance"))
FILL = 0.93  # of the limits that the largest amplitude is brought to
FILL_TOLERANCE_RATIO = 1.02  # of it that still counts as there
SCALING_ATTEMPTS = 8  # torques that are tried on the way to the limits


@dataclass(frozen=True)
class Shape:
    """A kind of excitation that only lacks its torque."""

    make: Callable[[float], ExcitationSet]  # of the peak torque in N m
    words: str  # "a slow sine"
    amplitudes: tuple[float, ...] = AMPLITUDES


@dataclass(frozen=True)
class Rehearsal:
    """What a set would do: its strain is the largest of travel, rate and torque over what is allowed."""

    strain: float
    travel_deg: float
    seen: tuple[Array, ...]


@dataclass(frozen=True)
class Candidate:
    """A shape at one amplitude, within the limits on every model it was held against."""

    planned: PlannedSet
    shape: Shape
    share: float  # of the largest amplitude that the limits allow
    travel_deg: float  # predicted, the larger of the models'
    seen: tuple[Array, ...]  # by the sensor, without noise, one array a model

    @property
    def words(self) -> str:
        """What it is, as part of a sentence."""
        size = "" if self.share == 1.0 else f" at {self.share:.0%} of the amplitude that the limits allow"
        return f"{self.shape.words}{size}"


def shapes(natural_hz: float, sample_rate_hz: float) -> tuple[Shape, ...]:
    """What to choose from, for a platform that swings at ``natural_hz`` and a sensor read at ``sample_rate_hz``."""
    length = float(np.clip(math.ceil(SET_PERIODS / natural_hz), MIN_SET_S, MAX_SET_S))
    top = MAX_SINE_FREQUENCY_SHARE * sample_rate_hz
    out = [_sine(f * natural_hz, length, words) for f, words in (*TONES, *HIGH_TONES) if f * natural_hz < top]
    out.append(_sine(0.31 * natural_hz, DRIFT_SET_S, "a long sine", (1.0,)))
    for low, high, words in (
        (0.02, 0.5, "a slow multisine"), (0.1, 2.0, "a multisine around resonance"),
        (1.2, 3.0, "a multisine above resonance"),
    ):  # fmt: skip
        if low * natural_hz < 0.5 * top:
            out.append(_multisine(low * natural_hz, min(high * natural_hz, top), 2.0 * length, words))
    out.append(_chirp(0.1 * natural_hz, min(3.0 * natural_hz, top), 2.0 * length))
    out.append(_ramp(3.0, 3.0, 2, "a slow push, hold and release"))
    out.append(_ramp(1.0, 18.0, 1, "a long hold", (1.0, 0.3)))
    out.append(_decay(length))
    return tuple(out)


def _hz(value: float) -> float:
    return float(f"{value:.3g}")


def _sine(hz: float, length_s: float, words: str, amplitudes: tuple[float, ...] = AMPLITUDES) -> Shape:
    long_enough = max(length_s, min(DRIFT_SET_S, math.ceil(4.0 / hz)))
    return Shape(lambda m: Sine(torque_nm=m, frequency_hz=_hz(hz), duration_s=long_enough), words, amplitudes)


def _multisine(low: float, high: float, length_s: float, words: str) -> Shape:
    def make(torque_nm: float) -> ExcitationSet:
        return Multisine(
            kind="multisine", torque_nm=torque_nm, from_hz=_hz(low), to_hz=_hz(high), tones=20, duration_s=length_s
        )

    return Shape(make, words)


def _chirp(low: float, high: float, length_s: float) -> Shape:
    def make(torque_nm: float) -> ExcitationSet:
        return Chirp(kind="chirp", torque_nm=torque_nm, from_hz=_hz(low), to_hz=_hz(high), duration_s=length_s)

    return Shape(make, "a sweep through the resonance")


def _ramp(ramp_s: float, hold_s: float, cycles: int, words: str, amplitudes: tuple[float, ...] = AMPLITUDES) -> Shape:
    busy = cycles * (2.0 * ramp_s + hold_s)

    def make(torque_nm: float) -> ExcitationSet:
        return RampHoldRelease(
            kind="ramp_hold_release", torque_nm=torque_nm, ramp_s=ramp_s, hold_s=hold_s, release_s=ramp_s,
            cycles=cycles, duration_s=busy + 2.0,
        )  # fmt: skip

    return Shape(make, words, amplitudes)


def _decay(length_s: float) -> Shape:
    return Shape(
        lambda m: FreeDecay(kind="free_decay", torque_nm=m, pull_s=2.0, hold_s=0.5, duration_s=2.5 + length_s),
        "a free decay",
    )


class _Bench:
    """One shape on several platforms, ready to be simulated at any torque."""

    def __init__(self, shape: Shape, platforms: Sequence[Platform], allowed: Peaks, sensor: Sensor) -> None:
        self._allowed, self._angle = allowed, sensor.channel == "angle"
        unit = shape.make(1.0)
        time = np.arange(round(unit.duration_s * sensor.sample_rate_hz) + 1) / sensor.sample_rate_hz
        torque = np.asarray(unit.torque(time), dtype=float)
        self._peak = float(np.max(np.abs(torque)))
        self._equations = [Equations(p) for p in platforms]
        signal = TorqueSignal(time, torque)
        substeps = [e.substeps(1.0 / sensor.sample_rate_hz) for e in self._equations]
        grids = {n: Grid(time, signal, n) for n in set(substeps)}
        self._grids = [grids[n] for n in substeps]

    def play(self, torque_nm: float) -> Rehearsal:
        """From rest, at this peak torque."""
        worst, farthest, seen = torque_nm * self._peak / self._allowed.torque_nm, 0.0, []
        for grid, equations in zip(self._grids, self._equations, strict=True):
            with np.errstate(all="ignore"):
                motion = grid.scaled(torque_nm).simulate(equations, (0.0, 0.0))
            travel, rate = (math.degrees(float(np.max(np.abs(x)))) for x in (motion.angle_rad, motion.rate_rad_s))
            if not (math.isfinite(travel) and math.isfinite(rate)):
                return Rehearsal(math.inf, math.inf, ())
            worst = max(worst, travel / self._allowed.travel_deg, rate / self._allowed.rate_deg_s)
            farthest = max(farthest, travel)
            seen.append(motion.angle_rad if self._angle else motion.sensed_rate_rad_s)
            if worst > 1.0:
                break  # too much on one is too much
        return Rehearsal(worst, farthest, tuple(seen))

    def largest(self) -> float | None:
        """The peak torque that stays within the limits on every platform; None where none is found."""
        torque, best = self._allowed.torque_nm / max(self._peak, 1e-300), None
        most = torque
        for _ in range(SCALING_ATTEMPTS):
            strain = self.play(torque).strain
            if strain <= 1.0:
                best = torque
                if strain >= FILL / FILL_TOLERANCE_RATIO or torque >= most:
                    break
            # Not in proportion where there are effects: try again with what it should have been.
            factor = FILL / strain if math.isfinite(strain) and strain > 0.0 else 0.1
            torque = min(most, torque * float(np.clip(factor, 0.02, 5.0)))
        return best


def candidates(
    several: Sequence[Shape], platforms: Sequence[Platform], allowed: Peaks, sensor: Sensor, least_nm: float = 0.0
) -> list[Candidate]:
    """Every shape at every amplitude that stays within the limits on all platforms, from ``least_nm`` on."""

    def of_shape(shape: Shape) -> list[Candidate]:
        bench = _Bench(shape, platforms, allowed, sensor)
        most = bench.largest()
        out = []
        for torque, share in ((float(f"{share * (most or 0.0):.3g}"), share) for share in shape.amplitudes):
            rehearsal = bench.play(torque) if torque > least_nm else None
            if rehearsal is not None and rehearsal.strain <= 1.0:
                made = shape.make(torque)
                out.append(Candidate(PlannedSet(made.title, made), shape, share, rehearsal.travel_deg, rehearsal.seen))
        return out

    with ThreadPoolExecutor(2) as workers:
        return [candidate for found in workers.map(of_shape, several) for candidate in found]


def fitting(candidate: Candidate, platforms: Sequence[Platform], allowed: Peaks) -> Candidate | None:
    """The candidate as the pre-flight itself lets it pass on every platform, with a little less torque if need be."""
    scale = min(predict(p, candidate.planned, allowed).scale for p in platforms)
    if scale >= 1.0:
        return candidate
    made = candidate.planned.excitation
    torque = float(f"{0.99 * scale * made.model_dump()['torque_nm']:.3g}")
    return replace(candidate, planned=PlannedSet(made.title, candidate.shape.make(torque))) if torque > 0.0 else None
