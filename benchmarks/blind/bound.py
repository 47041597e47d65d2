"""What a record can show at all, by the generator's own model.

The energy of an effect is the sum of squares, in units of the sensor's variance, that it leaves in the
noise-free record after inertia, damping, stiffness and every nuisance (start angle and rate of each set, and
the bias of a gyro) have been fitted as well as they can. For a small effect it is the inverse of the
Cramer-Rao bound on the relative size, squared: an energy of 49 says that the size stands seven standard
errors from zero. Rule of the bench: below 49 an effect counts as undetectable. (Naming is a choice among two
dozen effects with shapes of their own; a Bayesian price of three numbers on 50,000 samples is already 32.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from benchmarks.blind.excitations import Excitation
from benchmarks.blind.hidden import Hidden, Record

DETECTABLE = 49.0
STEP = 1e-4  # relative, of the differences


@dataclass(frozen=True)
class Energy:
    """``energy`` in units of the noise; ``rms`` of what is left over the noise."""

    energy: float
    rms: float

    @property
    def detectable(self) -> bool:
        """Whether the record can show it."""
        return self.energy >= DETECTABLE


def series(hidden: Hidden, records: Sequence[Record]) -> list[Any]:
    """The measured channel without noise, one array a set."""
    return [r.sensed_rate_rad_s if hidden.channel == "rate" else r.angle_rad for r in records]


def nuisances(hidden: Hidden, times: Any) -> Any:
    """What a free start and a bias add to one set, shape (n, 2 or 3)."""
    j, c, k = hidden.inertia, hidden.damping, hidden.stiffness
    root = np.sqrt(complex(c * c - 4.0 * j * k))
    first, second = (-c + root) / (2.0 * j), (-c - root) / (2.0 * j)
    columns = []
    for angle, rate in ((1.0, 0.0), (0.0, 1.0)):
        a = (rate - second * angle) / (first - second)
        b = angle - a
        grown = (a * np.exp(first * times), b * np.exp(second * times))
        if hidden.channel == "rate":
            grown = (first * grown[0], second * grown[1])
        columns.append((grown[0] + grown[1]).real)
    if hidden.channel == "rate":
        columns.append(np.ones(len(times)))
    return np.stack(columns, axis=1)


def left(hidden: Hidden, sets: Sequence[Excitation], differences: Sequence[Sequence[Any]]) -> list[float]:
    """Sum of squares of each difference (one array a set) once J, C, K and nuisances have taken what they can."""
    plain = replace(hidden, effects={}, bias=0.0)
    base = series(plain, plain.play(sets))
    slopes = []
    for name in ("inertia", "damping", "stiffness"):
        value = getattr(plain, name)
        other = series(plain, replace(plain, **{name: value * (1.0 + STEP)}).play(sets))
        slopes.append([(o - b) / STEP for o, b in zip(other, base, strict=True)])
    cleared_slopes, cleared = [[] for _ in slopes], [[] for _ in differences]  # type: ignore[var-annotated]
    for i, excitation in enumerate(sets):
        q, _ = np.linalg.qr(nuisances(plain, excitation.times(plain.step_s)))
        for given, out in ((slopes, cleared_slopes), (differences, cleared)):
            for row, part in zip(given, out, strict=True):
                part.append(row[i] - q @ (q.T @ row[i]))
    q, _ = np.linalg.qr(np.stack([np.concatenate(row) for row in cleared_slopes], axis=1))
    whole = [np.concatenate(row) for row in cleared]
    return [float(np.sum((d - q @ (q.T @ d)) ** 2)) for d in whole]


def refitted(hidden: Hidden, sets: Sequence[Excitation], full: Sequence[Any], start: Sequence[float]) -> float:
    """Sum of squares that the plain model leaves in ``full`` where the slopes at the truth are no guide.

    ``start`` are inertia, damping and stiffness to begin from: those of a platform whose ring has another frequency.
    """
    plain = replace(hidden, effects={}, bias=0.0)

    def rest(logs: Any) -> Any:
        j, c, k = (float(x) for x in np.exp(logs))
        model = replace(plain, inertia=j, damping=c, stiffness=k)
        out = []
        for excitation, a, b in zip(sets, full, series(model, model.play(sets)), strict=True):
            q, _ = np.linalg.qr(nuisances(model, excitation.times(plain.step_s)))
            out.append((a - b) - q @ (q.T @ (a - b)))
        return np.concatenate(out)

    return float(2.0 * least_squares(rest, np.log(start), diff_step=1e-6, max_nfev=8).cost)


def _much_alike(hidden: Hidden) -> tuple[float, float, float] | None:
    """J, C, K of a plain platform that moves much like one with a large effect, where there is such a one.

    A second inertia below its own resonance is just more inertia, and a mass off the axis just more stiffness.
    """
    j, c, k = hidden.inertia, hidden.damping, hidden.stiffness
    if "flexible_mode" in hidden.effects:
        return j + hidden.effects["flexible_mode"]["inertia"], c, k
    if "unbalance" in hidden.effects:
        at, of = hidden.rest_angle(), hidden.effects["unbalance"]
        return j, c, k + of["sine"] * math.cos(at) - of["cosine"] * math.sin(at)
    return None


def energies(hidden: Hidden, sets: Sequence[Excitation], records: Sequence[Record]) -> dict[str, Energy]:
    """The energy of every effect beside the others, and of a pair as a whole under "all"."""
    if not hidden.effects:
        return {}
    full = series(hidden, records)
    without = []
    for name in hidden.effects:
        rest = {n: v for n, v in hidden.effects.items() if n != name}
        less = replace(hidden, effects=rest)
        without.append([a - b for a, b in zip(full, series(less, less.play(sets)), strict=True)])
    count = sum(len(r.time_s) for r in records)
    out = {}
    for name, linear in zip(hidden.effects, left(hidden, sets, without), strict=True):
        total = linear
        start = _much_alike(hidden) if len(hidden.effects) == 1 else None
        if start:
            total = min(linear, refitted(hidden, sets, full, start))
        scaled = total / hidden.noise**2
        out[name] = Energy(scaled, (scaled / count) ** 0.5)
    return out
