"""The excitations that a follow-up may choose from: what each is good for, and how much torque the limits leave it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rig.dynamics import TorqueSignal, simulate
from rig.excitation import Chirp, ExcitationSet, FreeDecay, Multisine, PlannedSet, RampHoldRelease, Sine
from rig.platform import Platform
from rig.preflight import Peaks, predict

AMPLITUDES = (1.0, 0.3, 0.1, 0.03)  # of what the limits allow
SHORTEST_S, LONGEST_S = 5.0, 15.0
PERIODS = 100.0  # of the platform's own oscillation in a set
SLOW_S = 40.0  # a set long enough for what drifts
NYQUIST_SHARE = 0.4  # of half the sample rate: the highest frequency played
TONES = (
    (0.017, "a slow sine"),
    (0.1, "a slow sine"),
    (0.31, "a sine"),
    (0.7, "a sine"),
    (0.95, "a sine near resonance"),
)
ABOVE = ((1.6, "a sine above resonance"), (4.0, "a sine far above resonance"))
FILL = 0.93  # of the limits that the largest amplitude is brought to
WIDE = 1.02  # of it that still counts as there
ATTEMPTS = 8


@dataclass(frozen=True)
class Shape:
    """A kind of excitation that only lacks its torque."""

    make: Callable[[float], ExcitationSet]  # of the peak torque in N m
    words: str  # "a slow sine"
    amplitudes: tuple[float, ...] = AMPLITUDES


@dataclass(frozen=True)
class Candidate:
    """A shape at one amplitude, within the limits on every model it was held against."""

    planned: PlannedSet
    shape: Shape
    share: float  # of the largest amplitude that the limits allow
    travel_deg: float  # predicted, the larger of the models'

    @property
    def words(self) -> str:
        """What it is, as part of a sentence."""
        size = "" if self.share == 1.0 else f" at {self.share:.0%} of the amplitude that the limits allow"
        return f"{self.shape.words}{size}"


def shapes(natural_hz: float, sample_rate_hz: float) -> tuple[Shape, ...]:
    """What to choose from, for a platform that swings at ``natural_hz`` and a sensor read at ``sample_rate_hz``."""
    length = float(np.clip(math.ceil(PERIODS / natural_hz), SHORTEST_S, LONGEST_S))
    top = NYQUIST_SHARE * 0.5 * sample_rate_hz
    out = [_sine(f * natural_hz, length, words) for f, words in (*TONES, *ABOVE) if f * natural_hz < top]
    out.append(_sine(0.31 * natural_hz, SLOW_S, "a long sine", (1.0,)))
    for low, high, words in (
        (0.02, 0.5, "many slow tones at once"), (0.1, 2.0, "many tones around resonance"),
        (1.2, 6.0, "many tones above resonance"),
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
    long_enough = max(length_s, min(SLOW_S, math.ceil(4.0 / hz)))
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


def strain(platform: Platform, planned: PlannedSet, allowed: Peaks, sample_rate_hz: float) -> tuple[float, float]:
    """The largest of travel, rate and torque over what is allowed, and the travel in degrees; from rest."""
    time = np.arange(round(planned.duration_s * sample_rate_hz) + 1) / sample_rate_hz
    torque = np.asarray(planned.torque(time), dtype=float)
    with np.errstate(all="ignore"):
        motion = simulate(platform, time, TorqueSignal(time, torque))
    travel, rate = (math.degrees(float(np.max(np.abs(x)))) for x in (motion.angle_rad, motion.rate_rad_s))
    if not (math.isfinite(travel) and math.isfinite(rate)):
        return math.inf, math.inf
    found = Peaks(travel, rate, float(np.max(np.abs(torque))))
    return max(value / limit for value, limit in zip(found, allowed, strict=True)), travel


def largest(shape: Shape, platforms: Sequence[Platform], allowed: Peaks, sample_rate_hz: float) -> float | None:
    """The peak torque with which a shape stays within the limits on every platform; None where none is found."""
    torque, best = allowed.torque_nm, None
    for _ in range(ATTEMPTS):
        planned = PlannedSet("", shape.make(torque))
        worst = max(strain(p, planned, allowed, sample_rate_hz)[0] for p in platforms)
        if worst <= 1.0:
            best = torque
            if worst >= FILL / WIDE or torque >= allowed.torque_nm:
                break
        # Not in proportion where there are effects: try again with what it should have been.
        factor = FILL / worst if math.isfinite(worst) and worst > 0.0 else 0.1
        torque = min(allowed.torque_nm, torque * float(np.clip(factor, 0.02, 5.0)))
    return best


def candidates(
    several: Sequence[Shape], platforms: Sequence[Platform], allowed: Peaks, sample_rate_hz: float
) -> list[Candidate]:
    """Every shape at every amplitude, named by what it is."""
    out = []
    for shape in several:
        most = largest(shape, platforms, allowed, sample_rate_hz)
        if most is None:
            continue
        for share in shape.amplitudes:
            made = shape.make(float(f"{share * most:.3g}"))
            planned = PlannedSet(made.title, made)
            reached = [strain(p, planned, allowed, sample_rate_hz) for p in platforms]
            if max(s for s, _ in reached) <= 1.0:
                out.append(Candidate(planned, shape, share, max(travel for _, travel in reached)))
    return out


def passes(planned: PlannedSet, platforms: Sequence[Platform], allowed: Peaks) -> bool:
    """Whether the pre-flight itself would let a set pass on every platform."""
    return all(predict(p, planned, allowed).passes for p in platforms)
