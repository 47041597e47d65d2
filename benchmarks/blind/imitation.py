"""Whether another effect could pass for the true one in a record, by the generator's own model.

The rival is given the numbers with which it comes as close as it can to the noise-free record, inertia,
damping, stiffness and the starts of every set free. What it still leaves is the energy by which the record
parts the two; below ``bound.DETECTABLE`` the record cannot, and the tool has to say so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from benchmarks.blind.bound import STEP, nuisances, series
from benchmarks.blind.cases import _scale, rms
from benchmarks.blind.excitations import Excitation
from benchmarks.blind.hidden import ORDER, Diverged, Hidden
from benchmarks.blind.library import EVERYTHING, drawn

# Who is worth a look for whom: effects that act in the same place and way.
FAMILIES = (
    frozenset({"coulomb_friction", "stribeck_friction", "presliding_friction", "hysteresis"}),
    frozenset({"coulomb_friction", "load_dependent_friction"}),
    frozenset({"torque_delay", "actuator_lag"}),
    frozenset({"cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness", "backlash", "torque_saturation"}),
    frozenset({"creep", "hysteresis", "flexible_mode"}),
    frozenset({"quadratic_damping", "directional_damping", "coulomb_friction"}),
)  # fmt: skip
EVALUATIONS = 12
FREE = ("inertia", "damping", "stiffness")


def rivals_of(name: str) -> tuple[str, ...]:
    """Effects of the same families."""
    return tuple(sorted({r for family in FAMILIES if name in family for r in family} - {name}))


class Cleared:
    """Takes out of a difference what J, C, K and the nuisances of every set can take."""

    def __init__(self, hidden: Hidden, sets: Sequence[Excitation]) -> None:
        plain = replace(hidden, effects={}, bias=0.0)
        base = series(plain, plain.play(sets))
        self._each = [np.linalg.qr(nuisances(plain, e.times(plain.step_s)))[0] for e in sets]
        slopes = []
        for name in FREE:
            other = replace(plain, **{name: getattr(plain, name) * (1.0 + STEP)})  # type: ignore[arg-type]
            slopes.append(self._set_by_set([a - b for a, b in zip(series(other, other.play(sets)), base, strict=True)]))
        self._all = np.linalg.qr(np.stack(slopes, axis=1))[0]
        self.noise = hidden.noise

    def _set_by_set(self, difference: Sequence[Any]) -> Any:
        return np.concatenate([x - q @ (q.T @ x) for x, q in zip(difference, self._each, strict=True)])

    def __call__(self, difference: Sequence[Any]) -> Any:
        """What is left, in units of the noise, all sets end to end."""
        x = self._set_by_set(difference)
        return (x - self._all @ (self._all.T @ x)) / self.noise


def imitation(hidden: Hidden, sets: Sequence[Excitation], name: str, rival: str) -> float:
    """Least energy by which ``rival`` in the place of ``name`` differs from the truth (infinite: never close)."""
    rest = {n: v for n, v in hidden.effects.items() if n != name}
    bare = replace(hidden, effects=rest)
    records = bare.play(sets)
    truth = series(hidden, hidden.play(sets))
    cleared = Cleared(hidden, sets)
    size = max(rms(cleared([a - b for a, b in zip(truth, series(bare, records), strict=True)])), 1e-12)
    rng = np.random.default_rng(1)
    starts = 1 + sum(k not in EVERYTHING[rival].gains for k in ORDER[rival])  # one more for every shape
    scale = _scale(bare, sets, records)
    return min(_closest(bare, sets, truth, cleared, rival, drawn(rival, rng, scale), size) for _ in range(starts))


def _closest(
    bare: Hidden, sets: Sequence[Excitation], truth: Sequence[Any], cleared: Cleared, rival: str,
    numbers: Mapping[str, float], size: float,
) -> float:  # fmt: skip
    """Least squares over the rival's numbers, each times a factor."""
    keys = [k for k in ORDER[rival] if not k.endswith("_run")]
    best = [math.inf]

    def rest(x: Any) -> Any:
        given = {
            k: numbers[k] * (1.0 + v if EVERYTHING[rival].signed else math.exp(v)) for k, v in zip(keys, x, strict=True)
        }
        model = replace(bare, effects={**bare.effects, rival: given})
        try:
            left = cleared([a - b for a, b in zip(truth, series(model, model.play(sets)), strict=True)])
        except (Diverged, ValueError):
            return np.full(sum(len(t) for t in truth), 10.0 * size)
        best[0] = min(best[0], float(np.sum(left**2)))
        return left

    begin = np.zeros(len(keys))
    first = rms(rest(begin))
    if first > 0.0:  # a start of about the right size
        gains = [i for i, k in enumerate(keys) if k in EVERYTHING[rival].gains]
        if not EVERYTHING[rival].signed:
            begin[gains] = float(np.clip(math.log(size / max(abs(first - size), 0.1 * size)), -4.0, 4.0))
    least_squares(rest, begin, diff_step=1e-4, max_nfev=EVALUATIONS, ftol=1e-3, xtol=1e-6)
    return best[0]


def confusable(hidden: Hidden, sets: Sequence[Excitation], name: str) -> dict[str, float]:
    """Energy of every rival of an effect."""
    return {r: imitation(hidden, sets, name, r) for r in rivals_of(name) if r in EVERYTHING and r not in hidden.effects}
