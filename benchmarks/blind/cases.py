"""A case: a platform, a campaign, what is hidden, how large it is, and the record that a user would have."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter

from benchmarks.blind.bound import Energy, energies
from benchmarks.blind.excitations import Excitation, multisine, ramp, sine
from benchmarks.blind.hidden import Diverged, Hidden, Record
from benchmarks.blind.library import EVERYTHING, INSEPARABLE, LIBRARY, OUTSIDE, Rng, Scale, drawn, sized
from benchmarks.blind.physics import DRIVES

TRAVEL_RAD, RATE_RAD_S = math.radians(10.0), math.radians(400.0)
NOISE = tuple(math.radians(x) for x in (0.01, 0.05, 0.2))
NOISE_RAD = (1e-5, 5e-5, 2e-4)  # of an encoder
SIZES = (0.003, 0.01, 0.05)
PAPER_HZ = (0.5, 1.0, 3.0, 6.0, 9.0)
SINGLES = tuple(LIBRARY)
ROUNDS, NEAR = 8, 0.03  # of the search for the size
DRAWS = 12


@dataclass(frozen=True)
class Order:
    """What a case is to be."""

    kind: str  # single, pair, clean, torque_scale, outside
    effects: tuple[str, ...]
    size: float
    noise: int  # which of the three levels
    campaign: str


@dataclass(frozen=True)
class Case:
    """A case and its truth."""

    number: int
    order: Order
    hidden: Hidden
    sets: tuple[Excitation, ...]
    records: tuple[Record, ...]
    measured: tuple[Any, ...]
    sizes: Mapping[str, float]  # rms of what each effect adds over rms of the torque (of the rate: sensors)
    energy: Mapping[str, Energy]
    declared: tuple[float, float, float]

    def reference(self) -> tuple[float, float, float]:
        """J, C, K as the conventions count them, in the units of the recording's torque."""
        return reference(self.hidden)

    def truth(self) -> dict[str, Any]:
        """Everything that the tool does not see, as plain values."""
        return {
            "number": self.number, "kind": self.order.kind, "effects": list(self.order.effects),
            "asked_size": self.order.size, "campaign": self.order.campaign, "sizes": dict(self.sizes),
            "energy": {k: vars(v) for k, v in self.energy.items()}, "reference": list(self.reference()),
            "hidden": self.hidden.as_json(), "samples": sum(len(r.time_s) for r in self.records),
            "sets": [s.as_json() for s in self.sets],
        }  # fmt: skip


def reference(hidden: Hidden) -> tuple[float, float, float]:
    """J, C, K as the conventions of the result count them, times the error of the torque's scale."""
    j, c, k = hidden.inertia, hidden.damping, hidden.stiffness
    if "unbalance" in hidden.effects:
        v, rest = hidden.effects["unbalance"], hidden.rest_angle()
        k += v["sine"] * math.cos(rest) - v["cosine"] * math.sin(rest)
    return j * hidden.torque_scale, c * hidden.torque_scale, k * hidden.torque_scale


def orders(
    seed: int, count: int, kinds: Sequence[str] = (), effects: Sequence[str] = (), campaign: str = ""
) -> list[Order]:
    """The plan of a bench: shares of kinds fixed, effects and sizes dealt evenly, in an order drawn from the seed.

    ``campaign`` is the same for all of them where it is given.
    """
    rng = np.random.default_rng([seed, 1])
    shares = {"single": 0.5, "pair": 0.16, "outside": 0.16, "clean": 0.1, "torque_scale": 0.08}
    shares = {k: v for k, v in shares.items() if not kinds or k in kinds}
    total = sum(shares.values())
    wanted = [k for k, v in shares.items() for _ in range(round(count * v / total + 0.499))][:]
    rng.shuffle(wanted)
    inside = [e for e in SINGLES if not effects or e in effects]
    outside = [e for e in OUTSIDE if not effects or e in effects]
    decks = {"single": _deck(rng, inside), "outside": _deck(rng, outside)}
    out = []
    for kind in wanted[:count]:
        names: tuple[str, ...] = ()
        size = SIZES[int(rng.integers(3))]
        if kind in decks:
            names, size = next(decks[kind])
            size = max(size, SIZES[1]) if kind == "outside" else size
        elif kind == "pair":
            names, size = _pair(rng, inside), SIZES[1 + int(rng.integers(2))]
        out.append(Order(kind, names, size, int(rng.integers(3)), campaign or _campaign(rng)))
    return out


def _deck(rng: Rng, names: Sequence[str]) -> Any:
    """Every name at every size, shuffled, again and again."""
    while True:
        cards = [(n, s) for n in names for s in SIZES]
        rng.shuffle(cards)  # type: ignore[arg-type]
        yield from (((str(n),), float(s)) for n, s in cards)


def _pair(rng: Rng, names: Sequence[str]) -> tuple[str, str]:
    """Two effects that the physics can part; not two drive elements, whose order would be a third unknown."""
    pool = [n for n in names if n not in {"rate_bias", "torque_offset"}]
    while True:
        a, b = (str(x) for x in rng.choice(pool, 2, replace=False))
        drives = sum(n in DRIVES or n == "sensor_lag" for n in (a, b))
        if b not in INSEPARABLE.get(a, ()) and drives < 2 and not {a, b} <= _rubbing():
            return a, b


def _rubbing() -> set[str]:
    """Frictions that contain each other: a pair of them is one of them with other numbers."""
    return {"coulomb_friction", "stribeck_friction", "presliding_friction", "hysteresis"}


def _campaign(rng: Rng) -> str:
    return str(rng.choice(["five_sines", "soft", "odd_sines", "multisine", "ramps"], p=[0.6, 0.1, 0.12, 0.1, 0.08]))


def make(seed: int, number: int, order: Order) -> Case:
    """The case of that number.

    Raises
    ------
    Diverged
        Where no draw gave a platform that stays within the limits.
    """
    for draw in range(DRAWS):
        rng = np.random.default_rng([seed, 2, number, draw])
        try:
            return _make(rng, number, order)
        except (Diverged, ValueError):
            continue
    raise Diverged(f"case {number} ({order}): no draw stayed within the limits")


def _make(rng: Rng, number: int, order: Order) -> Case:
    natural, ratio = 10.0 * 4.5 ** rng.random(), 0.003 * 15.0 ** rng.random()
    j = 0.005 * 16.0 ** rng.random()
    k = j * (2.0 * math.pi * natural) ** 2
    c = 2.0 * ratio * math.sqrt(j * k)
    channel = "angle" if "torque_offset" in order.effects or (order.kind == "clean" and rng.random() < 0.2) else "rate"
    plain = Hidden(
        j, c, k, {}, (NOISE if channel == "rate" else NOISE_RAD)[order.noise],
        math.radians(rng.uniform(-0.05, 0.05)), channel, phase_seed=int(rng.integers(2**31)),
    )  # fmt: skip
    sets = _sets(rng, plain, order.campaign)
    if order.kind == "torque_scale":
        plain = replace(plain, torque_scale=float(rng.uniform(0.9, 1.1)))
    hidden, sets, records, sizes = _hide(rng, plain, sets, order)
    measured = tuple(hidden.measured(r, rng) for r in records)
    declared = tuple(float(x * 1.6 ** rng.uniform(-1.0, 1.0)) for x in reference(plain))
    energy = energies(hidden, sets, records)
    return Case(number, order, hidden, sets, tuple(records), measured, sizes, energy, declared)  # type: ignore[arg-type]


def _sets(rng: Rng, plain: Hidden, campaign: str) -> tuple[Excitation, ...]:
    """Sets of about fifty seconds in all, each scaled to a drawn share of the limits.

    ``low_sines`` are two sets of six seconds, ``short`` ones three of two.
    """
    sets = [sine(1.0, f) for f in PAPER_HZ]
    if campaign == "soft":
        soft = rng.random(5) < 0.5
        soft[rng.choice(5, 2, replace=False)] = False
        sets = [
            sine(1.0, f, 10.0, float(rng.uniform(0.5, 2.0)) if s else 0.0) for f, s in zip(PAPER_HZ, soft, strict=True)
        ]
    elif campaign == "low_sines":
        low = np.sort(rng.choice(PAPER_HZ[:3], 2, replace=False))
        sets = [sine(1.0, float(f), 6.0, 1.0) for f in low]  # the platform never rings
    elif campaign == "short":
        sets = [sine(1.0, f, 2.0) for f in (1.0, 3.0, 9.0)]
    elif campaign == "odd_sines":
        hz = np.sort(0.35 * (11.0 / 0.35) ** rng.random(int(rng.integers(4, 7))))
        sets = [sine(1.0, float(round(f, 3)), float(rng.integers(6, 14))) for f in hz]
    elif campaign == "multisine":
        sets = [sine(1.0, float(f)) for f in rng.choice(PAPER_HZ, 2, replace=False)]
        for low, high in ((0.4, 12.0), (1.0, 35.0)):
            cycles = np.unique(np.round(np.linspace(low, high, int(rng.integers(8, 20))) * 15.0))
            sets.append(multisine(1.0, cycles / 15.0, 15.0, 0.5, int(rng.integers(1000))))
    elif campaign == "ramps":
        sets = [sine(1.0, f) for f in (0.5, 3.0, 9.0)] + [ramp(1.0, 16.0, 2.0, 1.0, 3.0, 2)]
    out = []
    for excitation, record in zip(sets, plain.play(sets), strict=True):
        share = rng.uniform(0.55, 0.93)
        out.append(excitation.scaled(share / _strain(record)))
    return tuple(out)


def _strain(record: Record) -> float:
    """Largest share of a limit that a set uses."""
    travel = np.abs(record.angle_rad - record.angle_rad[0]).max() / TRAVEL_RAD
    return float(max(travel, np.abs(record.rate_rad_s).max() / RATE_RAD_S))


def _scale(plain: Hidden, sets: Sequence[Excitation], records: Sequence[Record]) -> Scale:
    u = np.concatenate([r.torque_nm for r in records])
    slope = np.concatenate([np.gradient(r.torque_nm, plain.step_s) for r in records])
    th, w = (np.concatenate([getattr(r, n) for r in records]) for n in ("angle_rad", "rate_rad_s"))
    hz = rms(slope) / rms(u) / (2.0 * math.pi)
    duration = float(np.mean([s.duration_s for s in sets]))
    return Scale(
        plain.inertia, plain.damping, plain.stiffness, rms(u), float(np.abs(u).max()), hz, rms(th),
        float(np.abs(th).max()), rms(w), duration,
    )  # fmt: skip


def rms(x: Any) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def _hide(rng: Rng, plain: Hidden, sets: tuple[Excitation, ...], order: Order) -> Any:
    """Give every effect its size within the played campaign, and keep the campaign within the limits."""
    records = plain.play(sets)
    if not order.effects:
        return plain, sets, records, {}
    scale = _scale(plain, sets, records)
    numbers = {n: sized(n, drawn(n, rng, scale), order.size / 0.01) for n in order.effects}
    for _ in range(ROUNDS):
        hidden = _with(plain, numbers, order.size, sets)
        numbers = {n: dict(v) for n, v in hidden.effects.items()}
        records = hidden.play(sets)
        sizes = {n: size_of(hidden, records, n) for n in order.effects}
        strain = [_strain(r) for r in records]
        wrong = [n for n in order.effects if EVERYTHING[n].gains and abs(sizes[n] / order.size - 1.0) > NEAR]
        if not wrong and max(strain) < 0.98:
            return hidden, sets, records, sizes
        sets = tuple(e.scaled(min(1.0, 0.93 / s)) if s >= 0.98 else e for e, s in zip(sets, strain, strict=True))
        for n in wrong:
            factor = float(np.clip(order.size / max(sizes[n], 1e-12), 0.2, 5.0))
            numbers[n] = sized(n, numbers[n], factor)
    if max(strain) >= 1.0 or any(not 0.6 < sizes[n] / order.size < 1.6 for n in wrong):
        raise Diverged("the size was not reached")
    return hidden, sets, records, sizes


def _with(plain: Hidden, numbers: Mapping[str, Mapping[str, float]], size: float, sets: Sequence[Excitation]) -> Hidden:
    """The platform with its effects; what depends on the whole campaign is set here."""
    numbers = dict(numbers)
    if "torque_saturation" in numbers:
        u = np.concatenate([np.abs(e.torque(e.times(plain.step_s))) for e in sets])
        target = size * rms(u)
        limit = brentq(lambda x: rms(np.maximum(u - x, 0.0)) - target, 1e-6 * u.max(), u.max())
        numbers["torque_saturation"] = {"limit": float(limit)}
    damping, stiffness = plain.damping, plain.stiffness
    if "flexible_mode" in numbers and numbers["flexible_mode"]["inertia"] > 1.5 * plain.inertia:
        raise Diverged("a second inertia that large is the platform itself")
    if "directional_damping" in numbers:  # neither side may push: the larger side is the negative one then
        damping += max(0.0, -numbers["directional_damping"]["step"])
    return replace(plain, damping=damping, stiffness=stiffness, effects=numbers)


def lagged(x: Any, steps: float) -> Any:
    """A series behind a first-order lag of so many steps, exact where it runs linearly between samples."""
    a = math.exp(-1.0 / steps)
    now = 1.0 - steps * (1.0 - a)
    return lfilter([now, 1.0 - a - now], [1.0, -a], x)


def size_of(hidden: Hidden, records: Sequence[Record], name: str) -> float:
    """Rms of what an effect adds to the torque over the rms of the torque asked for, over all sets.

    A gravity or cogging torque counts from its value at rest, which only shifts the rest angle. A gyro's lag
    counts as the lag of the torque that would make the same record; other faults of the gyro by the change of
    the rate over the rate.
    """
    u = np.concatenate([r.torque_nm for r in records])
    if name == "sensor_lag":
        late = np.concatenate([lagged(r.torque_nm, hidden.effects[name]["time"] / hidden.step_s) for r in records])
        return rms(u - late) / rms(u)
    if name in {"rate_bias", "aliased_vibration", "cubic_gyro"}:
        rate = np.concatenate([r.rate_rad_s for r in records])
        return rms(np.concatenate([r.sensed_rate_rad_s - r.rate_rad_s - hidden.bias for r in records])) / rms(rate)
    column = list(hidden.effects).index(name)
    part = [r.parts[:, column] for r in records]
    if name in {"unbalance", "cogging"}:
        part = [x - x[0] for x in part]
    return rms(np.concatenate(part)) / rms(u)
