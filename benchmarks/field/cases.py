"""Field cases: an order says what to hide, ``make`` draws rigs until one shows it, and records it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.field import library
from benchmarks.field.evidence import Evidence, weigh
from benchmarks.field.library import EVERYTHING, LIBRARY, OUTSIDE, Rng, Scale
from benchmarks.field.noise import draw_between, rms_of
from benchmarks.field.oracle import motion_columns, torque_along
from benchmarks.field.recording import Levels, Measured, Motion, levels, measure, play
from benchmarks.field.rigs import Rig, Unsuitable, draw

KINDS = ("single", "pair", "triple", "outside", "nothing")
# Of twenty cases in a row.
MIX = ("single",) * 8 + ("pair",) * 4 + ("triple",) * 2 + ("outside",) * 3 + ("nothing",) * 3
TIMES_DISTURBANCE = (2.0, 30.0)  # rms of an effect that J, C, K leave, over that of the disturbance
ATTEMPTS = 60
ROUNDS = 6
GUESSED = (1.5, 3.0, 1.5)  # factor within which J, C, K are declared
MOST_STANDSTILL = 0.5  # share of a record


@dataclass(frozen=True)
class Order:
    """What a case is to hide."""

    kind: str
    effects: tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """One case: the truth, and what is written for the tool."""

    number: int
    order: Order
    rig: Rig
    size: Levels
    disturbance_nm: float
    measured: tuple[Measured, ...]
    times_disturbance: Mapping[str, float]
    evidence: Evidence
    terms: tuple[str, ...]  # of the declared model; empty: not said
    declared: tuple[float, float, float]  # J, C, K as somebody would guess them, SI units
    attempts: int

    def truth(self) -> dict[str, Any]:
        """All that is known of a case, as JSON."""
        return {
            "number": self.number, "kind": self.order.kind, "effects": list(self.order.effects),
            "rig": self.rig.as_json(), "levels": asdict(self.size), "disturbance_nm": self.disturbance_nm,
            "times_disturbance": dict(self.times_disturbance), "evidence": asdict(self.evidence),
            "terms": list(self.terms), "declared": list(self.declared), "attempts": self.attempts,
            "samples": sum(len(m.columns["time_s"]) for m in self.measured), "runs": len(self.measured),
            "names": {n: ("library" if n in LIBRARY else "outside") for n in self.order.effects},
        }  # fmt: skip


def orders(seed: int, count: int, kinds: Sequence[str] = (), effects: Sequence[str] = ()) -> list[tuple[int, Order]]:
    """Numbers and orders of ``count`` cases; ``kinds`` and ``effects`` leave out others, numbers stay theirs."""
    rng = np.random.default_rng([seed, 7])
    decks: dict[str, list[str]] = {"library": [], "outside": []}

    def deal(deck: str) -> str:
        if not decks[deck]:
            decks[deck] = [str(n) for n in rng.permutation(list(LIBRARY if deck == "library" else OUTSIDE))]
        return decks[deck].pop()

    out: list[tuple[int, Order]] = []
    mix: list[str] = []
    number = 0
    while len(out) < count and number < 100 * count + 1000:
        mix = mix or [str(k) for k in rng.permutation(MIX)]
        kind = mix.pop()
        if kind == "nothing":
            names: tuple[str, ...] = ()
        elif kind == "outside":
            names = (deal("outside"),)
            if rng.random() < 0.3:
                names = _grown(rng, names, 2)
        else:
            names = _grown(rng, (deal("library"),), {"single": 1, "pair": 2, "triple": 3}[kind])
        if (not kinds or kind in kinds) and (not effects or set(names) & set(effects)):
            out.append((number, Order(kind, names)))
        number += 1
    return out


def _grown(rng: Rng, names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """More effects that agree with those there; friction is among them as often as on real rigs."""
    while len(names) < count:
        usual = rng.random() < 0.5 and "coulomb_friction" not in names
        name = "coulomb_friction" if usual else str(rng.choice(list(LIBRARY)))
        if name not in names and library.agree((*names, name)):
            names = (*names, name)
        elif usual:
            name = str(rng.choice(list(LIBRARY)))
            if name not in names and library.agree((*names, name)):
                names = (*names, name)
    return names


def make(seed: int, number: int, order: Order) -> Case:
    """Draw rigs until one shows what was ordered, and record it.

    Raises
    ------
    Unsuitable
        Where none of ``ATTEMPTS`` rigs does.
    """
    why: list[str] = []
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, number, attempt])
        try:
            return _attempt(rng, (seed, number, attempt), number, order, attempt + 1)
        except Unsuitable as error:
            why.append(str(error))
    raise Unsuitable(f"case {number} ({'+'.join(order.effects) or order.kind}): " + "; ".join(sorted(set(why))))


def _attempt(rng: Rng, seed: tuple[int, ...], number: int, order: Order, attempts: int) -> Case:
    spring, want = library.wanted(order.effects, rng)
    rig = draw(rng, spring, want)
    terms: tuple[str, ...] = ("inertia", "damping") if not spring and rng.random() < 0.4 else ()
    j, c, k = (
        x * draw_between(rng, 1.0 / most, most)
        for x, most in zip((rig.inertia, rig.damping, rig.stiffness), GUESSED, strict=True)
    )
    shares = rng.uniform(0.6, 1.0, len(rig.seconds)) * rig.travel_rad
    gains, size = _calibrated(rig, shares, seed)
    disturbance = rig.disturbance * size.torque
    times: dict[str, float] = {}
    if order.effects:
        rig, gains, times = _hidden(rng, rig, gains, shares, size, disturbance, order, seed)
    motions = play(rig, gains, disturbance, _peak(rig), (*seed, 5))
    size = levels(rig, motions, gains)
    if float(np.mean(np.concatenate([m.rate[m.before :] == 0.0 for m in motions]))) > MOST_STANDSTILL:
        raise Unsuitable("stands still for most of the record")
    times = {n: _size_of(rig, motions, n) / disturbance for n in order.effects}
    if any(t < TIMES_DISTURBANCE[0] for t in times.values()):
        raise Unsuitable("too small beside the disturbance")
    seen = measure(rig, motions, size, (*seed, 6))
    evidence = weigh(rig, motions, seen, size, disturbance, _scale(rig, motions, size), order.kind == "outside")
    return Case(number, order, rig, size, disturbance, tuple(seen), times, evidence, terms, (j, c, k), attempts)


def _peak(rig: Rig) -> float:
    """Peak rate to expect, rad/s."""
    return 2.0 * math.pi * max(rig.own_hz, rig.low_hz) * rig.travel_rad


def _travel(motions: Sequence[Motion]) -> Any:
    """Peak angle from the start of each run, rad."""
    return np.array([np.abs(m.angle[m.before :] - m.angle[m.before]).max() for m in motions])


def _calibrated(rig: Rig, travel: Any, seed: Sequence[int]) -> tuple[Any, Levels]:
    """Amplitude of each run with which the rig moves as far as asked, without effects and disturbance."""
    if rig.loop != "open":
        gains: Any = np.array(travel)
    else:
        middle = 2.0 * math.pi * math.sqrt(rig.low_hz * rig.high_hz)
        gains = travel * (rig.stiffness or rig.inertia * middle * middle)
        gains = gains * travel / np.maximum(_travel(play(rig, gains, 0.0, _peak(rig), (*seed, 4))), 1e-12)
    return gains, levels(rig, play(rig, gains, 0.0, _peak(rig), (*seed, 4)), gains)


def _scale(rig: Rig, motions: Sequence[Motion], size: Levels) -> Scale:
    angle = [m.angle[m.before :] - m.angle[m.before] for m in motions]
    middle = size.rate / max(rms_of([a - a.mean() for a in angle]), 1e-12) / (2.0 * math.pi)
    torque = np.concatenate([m.mean(m.asked) for m in motions])
    return Scale(
        size.torque, size.torque_peak, size.rate, size.rate_peak, rms_of(angle),
        max(float(np.abs(a).max()) for a in angle), middle, library.spectral_middle(torque, rig.sample_s),
        float(np.mean(rig.seconds)), rig,
    )  # fmt: skip


def _hidden(
    rng: Rng, plain: Rig, gains: Any, travel: Any, size: Levels, disturbance: float, order: Order, seed: Sequence[int]
) -> tuple[Rig, Any, dict[str, float]]:
    """Give every effect its size within the motion, and keep the motion as large as asked."""
    motions = play(plain, gains, 0.0, _peak(plain), (*seed, 4))
    scale = _scale(plain, motions, size)
    numbers = {n: library.drawn(n, rng, scale) for n in order.effects}
    most = {n: EVERYTHING[n].most * size.torque / disturbance / len(order.effects) ** 0.5 for n in order.effects}
    aims = {n: min(draw_between(rng, 1.5 * TIMES_DISTURBANCE[0], TIMES_DISTURBANCE[1]), most[n]) for n in order.effects}
    if "torque_saturation" in numbers:
        numbers["torque_saturation"] = _limit(motions, aims["torque_saturation"] * disturbance)
    found: dict[str, float] = {}
    for _ in range(ROUNDS):
        rig = replace(plain, effects=numbers)
        motions = play(rig, gains, disturbance, _peak(rig), (*seed, 5))
        found = {n: _size_of(rig, motions, n) / disturbance for n in order.effects}
        wrong = [n for n in order.effects if not 0.75 < found[n] / aims[n] < 1.33]
        moved = travel / np.maximum(_travel(motions), 1e-12)
        astray = np.any(moved > 2.0) or np.any(moved < 0.5)
        if not wrong and not astray:
            return rig, gains, found
        if astray and rig.loop == "open":
            gains = gains * np.clip(moved, 0.5, 2.0)
        for n in wrong:
            factor = float(np.clip(aims[n] / max(found[n], 1e-9), 0.25, 4.0))
            if n == "torque_saturation":
                numbers[n] = _limit(motions, factor * found[n] * disturbance)
            else:
                numbers[n] = library.scaled(n, numbers[n], factor)
    if any(not 0.4 < found[n] / aims[n] < 2.5 for n in order.effects):
        raise Unsuitable("the size was not reached")
    return rig, gains, found


def _limit(motions: Sequence[Motion], excess_nm: float) -> dict[str, float]:
    """The torque limit that takes a given rms from the torque asked for."""
    asked = np.abs(np.concatenate([m.mean(m.asked) for m in motions]))
    low, high = 0.0, float(asked.max())
    for _ in range(40):
        limit = 0.5 * (low + high)
        low, high = (limit, high) if rms_of([np.maximum(asked - limit, 0.0)]) > excess_nm else (low, limit)
    return {"limit": high}


def _size_of(rig: Rig, motions: Sequence[Motion], name: str) -> float:
    """Rms in N m of what J, C, K and a constant leave of an effect's torque along the true motion."""
    terms = 3 if rig.has_spring else 2
    part = np.concatenate([m.mean(torque_along(rig, m, name, rig.effects[name])) for m in motions])
    base = np.stack([np.concatenate([m.mean(motion_columns(m)[i]) for m in motions]) for i in range(terms)], axis=1)
    if name != "torque_offset":
        base = np.column_stack([base, np.ones(len(base))])
    base = base / np.maximum(np.sqrt(np.mean(base**2, axis=0)), 1e-300)
    return rms_of([part - base @ np.linalg.lstsq(base, part, rcond=None)[0]])
