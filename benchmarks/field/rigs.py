"""The rig of a case: inertia over six decades, its sample rate, control loop, sensors, clock and disturbance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from benchmarks.field.noise import draw_between
from benchmarks.field.plant import STATES
from benchmarks.field.references import SHAPES
from benchmarks.field.simulation import CASCADE, OPEN, POSITION_LOOP

Rng = np.random.Generator
SAMPLE_RATES_HZ = (50, 80, 100, 125, 200, 250, 400, 500, 800, 1000, 1250, 2000, 2500, 4000, 5000)
FEWEST_SAMPLES, USUAL_SAMPLES, MOST_SAMPLES = 5_000, 30_000, 60_000
SLOWEST_S = 5.0  # time constant of the disturbance's slow part
SLOW_TIMES = 30  # of them in a campaign at least: with fewer it is an offset, and no name for one is wrong
FINE = (10, 48)  # fine steps a sample: at least, at most
STEP_RAD = 0.2  # of the fastest motion in one fine step


class Unsuitable(Exception):
    """A draw that makes no sensible case; another one is drawn."""


@dataclass(frozen=True)
class Rig:
    """One axis, its drive, loop and sensors. SI units."""

    inertia: float
    damping: float
    stiffness: float
    own_hz: float  # natural frequency, or bandwidth of the loop where there is no spring
    sample_hz: float
    travel_rad: float  # peak of the motion asked for
    loop: str  # open, pd, cascade
    loop_hz: float
    rate_filter_s: float
    torque_column: str  # current, command
    current_loop_s: float  # 0 for a command
    current_noise: float  # share of the torque's rms
    current_bits: int  # of the torque's peak, both directions
    sensors: str  # gyro, encoder, both
    counts: int  # a turn, of the encoder
    loop_counts: int  # of the drive's own encoder
    gyro_noise: float  # shares of the rate's rms: white, flicker, walk a root second
    gyro_flicker: float
    gyro_walk: float
    gyro_corner_hz: float
    gyro_bias: float
    zero_anew: bool  # the encoder's zero is where each run begins
    jitter: float  # instants, parts of a sample
    wander: float
    stamp_error: float  # rms error of the stamps, parts of a sample
    lost: float  # share of samples
    lost_as_rows: bool  # rows are missing; else they stand there with valid = 0
    disturbance: float  # share of the torque's rms
    slow_share: float  # of the disturbance's variance
    slow_s: float
    band_hz: float
    shapes: tuple[str, ...]  # reference of each run
    seconds: tuple[float, ...]
    low_hz: float
    high_hz: float
    repeats: bool  # every run asks for the same
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @property
    def sample_s(self) -> float:
        """Time between two samples, s."""
        return 1.0 / self.sample_hz

    @property
    def has_spring(self) -> bool:
        """Whether a spring holds the axis."""
        return self.stiffness > 0.0

    def loop_numbers(self, encoder_step: float) -> Any:
        """Kind, kp, kd or kv, ki, filter time, encoder step, current loop time: what ``simulate`` takes."""
        w = 2.0 * math.pi * self.loop_hz
        tail = (max(self.rate_filter_s, 1e-9), encoder_step, self.current_loop_s)
        if self.loop == "pd":
            j = self.inertia
            return np.array([POSITION_LOOP, j * w * w, 1.4 * j * w, 0.0, *tail])
        if self.loop == "cascade":
            return np.array([CASCADE, 0.5 * w, self.inertia * w, 0.3 * self.inertia * w * w, *tail])
        return np.array([OPEN, 0.0, 0.0, 0.0, *tail])

    def fine_steps(self, peak_rate: float) -> int:
        """Fine steps a sample. Raises Unsuitable where the rig is too stiff for its sample rate."""
        j, k = self.inertia, self.stiffness
        fastest = [2.0 * math.pi * max(self.own_hz, self.loop_hz), self.damping / j]
        for name, v in self.effects.items():
            if name in {"presliding_friction", "hysteresis"}:
                width = v.get("displacement") or v["yield_angle"]
                fastest += [math.sqrt((k + v["level"] / width) / j), 0.5 * peak_rate / width]
            elif name == "flexible_mode":
                fastest.append(2.0 * math.pi * v["frequency"] * math.sqrt(1.0 + v["inertia"] / j))
            elif name in {"bump_stop", "hard_stops"}:
                fastest.append(2.0 * math.sqrt((k + v["stiffness"]) / j))
            elif name in {"cogging", "friction_by_angle"}:
                fastest.append(0.5 * v["order"] * peak_rate)
            elif name == "cable_bump":
                fastest.append(0.5 * peak_rate / v["width"])
            elif name in {"creep", "two_relaxations"}:
                fastest.append(0.5 / v["time"])
        steps = math.ceil(self.sample_s * max(fastest) / STEP_RAD)
        if steps > FINE[1]:
            raise Unsuitable(f"{steps} fine steps a sample")
        return max(FINE[0], steps)

    def layout(self) -> tuple[list[str], Any, Any, Any, int]:
        """Names, first state and first parameter of each effect, and the number of states in all."""
        names = list(self.effects)
        zo = 2 + np.concatenate([[0], np.cumsum([STATES.get(n, 0) for n in names])]).astype(np.int64)
        po = np.concatenate([[0], np.cumsum([len(self.effects[n]) for n in names])]).astype(np.int64)
        p = np.array([x for n in names for x in self.effects[n].values()] or [0.0])
        return names, zo[:-1], po[:-1], p, int(zo[-1])


def _runs(rng: Rng, sample_hz: float, low_hz: float) -> list[float]:
    """Lengths of the runs in s."""
    fewest, most = (FEWEST_SAMPLES, USUAL_SAMPLES) if rng.random() < 0.8 else (USUAL_SAMPLES, MOST_SAMPLES)
    total = draw_between(rng, fewest, most) / sample_hz
    counts = (1, int(rng.integers(2, 6)), int(rng.integers(6, 16)), int(rng.integers(16, 51)))
    count = int(rng.choice(counts, p=(0.4, 0.4, 0.15, 0.05)))
    shortest = max(3.0, 4.0 / low_hz)
    if shortest > 60.0:
        raise Unsuitable("too slow for a recording of a minute")
    each = float(np.clip(total / count, shortest, 60.0))
    count = int(np.clip(count, 1, max(1, 1.2 * most // (each * sample_hz))))
    if count * each * sample_hz > 1.3 * MOST_SAMPLES:
        raise Unsuitable("too many samples")
    if count * each * sample_hz < FEWEST_SAMPLES:
        count = math.ceil(FEWEST_SAMPLES / (each * sample_hz))
    if count > 50:
        raise Unsuitable("more than fifty runs")
    return [round(each * rng.uniform(0.9, 1.1), 2) if count > 1 else round(each, 2) for _ in range(count)]


def draw(rng: Rng, spring: bool, want: Mapping[str, Any]) -> Rig:
    """A rig without effects. ``want`` fixes fields that the effects of the case ask for."""
    inertia = draw_between(rng, 1e-4, 1e2)
    own_hz = 8.0 * (inertia / 0.02) ** -0.2 * 10.0 ** rng.uniform(-0.25, 0.45)
    loop = want.get("loop") or str(
        rng.choice(["open", "pd", "cascade"], p=[0.55, 0.3, 0.15] if spring else [0.12, 0.48, 0.4])
    )
    loop_hz = 0.0 if loop == "open" else own_hz * (rng.uniform(1.3, 2.5) if spring else 1.0)
    stiffness = inertia * (2.0 * math.pi * own_hz) ** 2 if spring else 0.0
    high_hz = own_hz * (rng.uniform(1.2, 2.5) if spring else rng.uniform(0.3, 0.9))
    low_hz = high_hz * draw_between(rng, 0.04, 0.25)
    middle = 2.0 * math.pi * math.sqrt(low_hz * high_hz)
    if spring:
        damping = 2.0 * draw_between(rng, 0.006, 0.3) * math.sqrt(inertia * stiffness)
    else:
        damping = inertia * middle * draw_between(rng, 0.15, 2.0)
    wanted = max(own_hz, loop_hz) * draw_between(rng, 25.0, 100.0)
    sample_hz = float(min(SAMPLE_RATES_HZ, key=lambda f: abs(math.log(f / wanted))))
    if sample_hz < 20.0 * max(own_hz, loop_hz):
        raise Unsuitable("sampled too slowly for its dynamics")
    seconds = _runs(rng, sample_hz, low_hz)
    repeats = len(seconds) > 1 and rng.random() < 0.3
    choices = list(SHAPES)
    shapes = (
        [str(rng.choice(choices))] * len(seconds) if repeats else [str(s) for s in rng.choice(choices, len(seconds))]
    )
    column = want.get("torque_column") or str(rng.choice(["current", "command"], p=[0.6, 0.4]))
    sensors = want.get("sensors") or str(
        rng.choice(["encoder", "gyro", "both"], p=[0.3, 0.45, 0.25] if spring else [0.65, 0.1, 0.25])
    )
    travel = want.get("travel_rad") or (draw_between(rng, 0.03, 0.5) if spring else draw_between(rng, 0.3, 12.0))
    fewest = max(1e3, 400.0 * 2.0 * math.pi / travel)
    counts = round(draw_between(rng, fewest, 1e6))
    loop_counts = counts if sensors != "gyro" else round(draw_between(rng, 2.0 * fewest, 1e6))
    uneven = rng.random() < 0.5
    return Rig(
        inertia=inertia, damping=damping, stiffness=stiffness, own_hz=own_hz, sample_hz=sample_hz, travel_rad=travel,
        loop=loop, loop_hz=loop_hz,
        rate_filter_s=max(2.0 / sample_hz, 1.0 / (2.0 * math.pi * 8.0 * max(loop_hz, 1e-9))),
        torque_column=column,
        current_loop_s=0.0 if column == "command" else 1.0 / (2.0 * math.pi * sample_hz * draw_between(rng, 0.15, 1.0)),
        current_noise=draw_between(rng, 3e-4, 1e-2), current_bits=int(rng.integers(9, 15)), sensors=sensors,
        counts=counts, loop_counts=loop_counts, gyro_noise=draw_between(rng, 2e-4, 1e-2),
        gyro_flicker=draw_between(rng, 2e-5, 1e-3), gyro_walk=draw_between(rng, 1e-5, 5e-4),
        gyro_corner_hz=sample_hz * draw_between(rng, 0.2, 2.0), gyro_bias=rng.normal(0.0, 0.01),
        zero_anew=bool(want.get("zero_anew", not spring and rng.random() < 0.6)),
        jitter=draw_between(rng, 0.01, 0.1) if uneven else 0.0,
        wander=draw_between(rng, 0.1, 3.0) if uneven and rng.random() < 0.5 else 0.0,
        stamp_error=draw_between(rng, 1e-3, 2e-2) if rng.random() < 0.4 else 0.0,
        lost=draw_between(rng, 3e-4, 2e-2) if rng.random() < 0.35 else 0.0,
        lost_as_rows=column == "current" and rng.random() < 0.6, disturbance=draw_between(rng, 1e-3, 3e-2),
        slow_share=rng.uniform(0.2, 0.8),
        slow_s=draw_between(rng, 0.04, 1.0) * min(SLOWEST_S, sum(seconds) / SLOW_TIMES),
        band_hz=sample_hz * draw_between(rng, 0.05, 0.5),
        shapes=tuple(shapes), seconds=tuple(seconds), low_hz=low_hz, high_hz=high_hz, repeats=repeats,
    )  # fmt: skip
