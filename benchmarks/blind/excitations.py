"""Torque over time, written from the description of the file format: sines, multisines, chirps, ramps, decays.

A set is one compiled record: a kind, a vector of numbers and a table of tones. The torque is known at every
instant, so nothing here is interpolated; a recording takes its values at the sample instants.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
import yaml

TONES, CHIRP, RAMP, DECAY = range(4)
NO_TONES = np.zeros((0, 3))
jit = nb.njit(cache=True, error_model="numpy")


@jit
def smooth(x):  # type: ignore[no-untyped-def]
    """0 below 0, 1 above 1, two derivatives zero at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


@jit
def torque_at(t, kind, a, tones):  # type: ignore[no-untyped-def]
    """Torque in N m; ``a`` is gain, duration, soft start and up to five numbers of the kind."""
    if t < 0.0 or t > a[1] * (1.0 + 1e-12):  # the last stage of the last step may lie a rounding error behind
        return 0.0
    gain = a[0] * (smooth(t / a[2]) if a[2] > 0.0 else 1.0)
    if kind == 0:
        total = 0.0
        for k in range(tones.shape[0]):
            total += tones[k, 1] * math.sin(2.0 * math.pi * tones[k, 0] * t + tones[k, 2])
        return gain * total
    if kind == 1:
        f0, f1, span = a[3], a[4], a[1]
        if a[5] == 0.0 or f0 == f1:
            cycles = f0 * t + 0.5 * (f1 - f0) / span * t * t
        else:
            cycles = f0 * span / math.log(f1 / f0) * ((f1 / f0) ** (t / span) - 1.0)
        return gain * math.sin(2.0 * math.pi * cycles)
    if kind == 2:
        period = a[3] + a[4] + a[5]
        cycle = math.floor(t / period)
        if cycle >= a[6]:
            return 0.0
        x = t - cycle * period
        push = smooth(x / a[3]) - smooth((x - a[3] - a[4]) / a[5])
        return gain * push * (1.0 - 2.0 * (cycle % 2.0))
    return gain * (smooth(t / a[3]) - smooth((t - a[3] - a[4]) / a[5]))


@jit
def torque_series(times, kind, a, tones):  # type: ignore[no-untyped-def]
    """Torque at several instants, shape as ``times``."""
    out = np.empty(len(times))
    for i in range(len(times)):
        out[i] = torque_at(times[i], kind, a, tones)
    return out


@dataclass(frozen=True)
class Excitation:
    """One set, from rest. ``numbers`` are gain in N m, duration and soft start in s, then those of the kind."""

    name: str
    kind: int
    numbers: tuple[float, ...]
    tones: Any = field(default_factory=lambda: NO_TONES)
    sine_hz: float | None = None
    cap_deg: float | None = None
    use: str = "auto"

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**vars(self), "numbers": list(self.numbers), "tones": self.tones.tolist()}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Excitation:
        """From ``as_json``."""
        tones = np.array(content["tones"], dtype=float).reshape(-1, 3)
        return cls(**{**content, "numbers": tuple(content["numbers"]), "tones": tones})

    @property
    def duration_s(self) -> float:
        """Length in s."""
        return self.numbers[1]

    @property
    def array(self) -> Any:
        """The numbers as the compiled functions take them, shape (8,)."""
        return np.array([*self.numbers, *([0.0] * (8 - len(self.numbers)))])

    def times(self, step_s: float) -> Any:
        """Sample instants, both ends included."""
        return np.arange(round(self.duration_s / step_s) + 1) * step_s

    def torque(self, times: Any) -> Any:
        """Torque in N m, shape as ``times``."""
        return torque_series(np.asarray(times, dtype=float), self.kind, self.array, self.tones)

    def scaled(self, factor: float) -> Excitation:
        """The same set with its torque multiplied."""
        return replace(self, numbers=(self.numbers[0] * factor, *self.numbers[1:]))


def sine(torque_nm: float, hz: float, duration_s: float = 10.0, soft_s: float = 0.0) -> Excitation:
    """A sine from rest."""
    name = f"{hz:g} Hz" + (" soft" if soft_s else "")
    return Excitation(name, TONES, (torque_nm, duration_s, soft_s), np.array([[hz, 1.0, 0.0]]), hz)


def multisine(
    torque_nm: float, hz: Sequence[float], duration_s: float, soft_s: float = 0.0, seed: int | None = None
) -> Excitation:
    """Equal tones, Schroeder phases or drawn ones; ``torque_nm`` is the peak of the sum before the soft start."""
    tones = np.array(sorted(hz))
    n = np.arange(1, len(tones) + 1)
    phases = -math.pi * n * (n - 1) / len(n)
    if seed is not None:
        phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, len(n))
    table = np.stack([tones, np.ones(len(n)), phases], axis=1)
    fine = np.linspace(0.0, duration_s, math.ceil(min(100.0 * tones[-1] * duration_s, 1e6)) + 1)
    peak = np.abs(torque_series(fine, TONES, np.array([1.0, duration_s, 0.0]), table)).max()
    table[:, 1] /= peak
    return Excitation(f"multisine {tones[0]:g}-{tones[-1]:g} Hz", TONES, (torque_nm, duration_s, soft_s), table)


def ramp(torque_nm: float, duration_s: float, ramp_s: float, hold_s: float, release_s: float, cycles: int) -> Any:
    """Push, hold and release, with alternating sign."""
    return Excitation(
        f"ramp {torque_nm:.4g} N m", RAMP, (torque_nm, duration_s, 0.0, ramp_s, hold_s, release_s, cycles)
    )


def _multisine(s: Mapping[str, Any], duration: float, soft: float) -> Excitation:
    hz = s.get("frequencies_hz")
    if not hz:
        cycles = np.linspace(s["from_hz"], s["to_hz"], s.get("tones", 20)) * duration
        hz = np.unique(np.maximum(1.0, np.round(cycles))) / duration
    seed = s.get("seed", 0) if s.get("phases", "schroeder") == "random" else None
    return multisine(s["torque_nm"], hz, duration, soft, seed)


def _chirp(s: Mapping[str, Any], duration: float, soft: float) -> Excitation:
    logarithmic = float(s.get("sweep", "linear") != "linear")
    numbers = (s["torque_nm"], duration, soft, s["from_hz"], s["to_hz"], logarithmic)
    return Excitation(f"chirp {s['from_hz']:g}-{s['to_hz']:g} Hz", CHIRP, numbers)


def _ramp(s: Mapping[str, Any], duration: float, soft: float) -> Excitation:
    parts = (s.get("ramp_s", 2.0), s.get("hold_s", 1.0), s.get("release_s", 2.0), s.get("cycles", 1))
    return ramp(s["torque_nm"], duration, *parts)


def _decay(s: Mapping[str, Any], duration: float, soft: float) -> Excitation:
    numbers = (s["torque_nm"], duration, 0.0, s.get("pull_s", 2.0), s.get("hold_s", 0.5), s.get("release_s", 0.01))
    return Excitation(f"free decay from {s['torque_nm']:g} N m", DECAY, numbers)


KINDS = {
    "sine": lambda s, duration, soft: sine(s["torque_nm"], s["frequency_hz"], duration, soft),
    "multisine": _multisine,
    "chirp": _chirp,
    "ramp_hold_release": _ramp,
    "free_decay": _decay,
}


def read(path: Path) -> tuple[tuple[Excitation, ...], float]:
    """The sets of an excitation file (or of any rig.yaml) in playing order, and the sample rate in Hz."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    section = content.get("excitation", content)
    out: list[Excitation] = []
    taken: set[str] = set()
    for s in section["sets"]:
        made = KINDS[s.get("kind", "sine")](s, float(s.get("duration_s", 10.0)), float(s.get("soft_start_s", 0.0)))
        made = replace(made, name=s.get("name") or made.name, cap_deg=s.get("travel_cap_deg"), use=s.get("use", "auto"))
        for factor in (1.0, *s.get("repeat_scales", ())):
            name, n = made.name if factor == 1.0 else f"{made.name} x{factor:g}", 2
            while name in taken:
                name, n = f"{made.name} ({n})", n + 1
            taken.add(name)
            out.append(replace(made.scaled(factor), name=name))
    return tuple(out), float(section.get("sample_rate_hz", 1000.0))
