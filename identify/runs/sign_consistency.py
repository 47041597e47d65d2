"""Runs whose torque was recorded with the opposite sign of the others': no model has both.

Behind one low-pass all runs share J, C and K, each with a sign of its own torque. The signs with which they explain
most are those they were recorded with, as long as the other sign of a run leaves most of its torque unexplained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from identify.runs.sign_convention import Swing, equations
from identify.signals.trace import UPSAMPLING, Trace
from rig.recording.run import Array

EXPLAINED = 0.7  # share of a run's torque that the shared platform explains with one sign
CONTRADICTED = 0.5  # share of it that is left with the other sign, refitted
MINOR = 0.3  # of the larger torque: a smaller one of inertia or spring that may have any sign
MAX_EXHAUSTIVE_RUNS = 10  # runs whose signs are tried in all ways; of more each is tried against the rest


@dataclass(frozen=True)
class _Run:
    """Normal equations of one run whose torque has unit power; ``added`` is what it has beside J, C and K, (3,)."""

    a: Array
    b: Array
    added: Array


def reversed_runs(traces: Sequence[Trace]) -> list[Trace]:
    """The runs whose torque has the opposite sign of the others'; none where that is not clear, or all agree."""
    found = [(t, run) for t in traces if (run := _normal(t)) is not None]
    if len(found) < 2:
        return []
    runs = [run for _, run in found]
    signs = _best(runs)
    turned = [i for i, s in enumerate(signs) if s < 0.0]
    if not turned or len(turned) == len(runs):
        return []
    values = _fit(runs, signs)
    if any(_left(runs[i], signs[i], values) > 1.0 - EXPLAINED for i in turned):
        return []
    for i in turned:
        other = signs.copy()
        other[i] = 1.0
        if _left(runs[i], 1.0, _fit(runs, other)) < CONTRADICTED:
            return []
    return [found[i][0] for i in turned]


def describe_reversed_runs(runs: Sequence[str]) -> str:
    """What was left out, in words; empty where nothing was."""
    if not runs:
        return ""
    one = len(runs) == 1
    return (
        f"Left out: {', '.join(runs)}, whose torque has the opposite sign of the other runs' "
        f"(turn it in {'that file' if one else 'those files'} and identify again)"
    )


def _normal(trace: Trace) -> _Run | None:
    if trace.torque is None:
        return None
    angle, rate, _, torque, _ = trace.fine
    time = trace.start_s + trace.step_s * np.arange(len(trace.measured))
    swing = Swing(time, angle[::UPSAMPLING], rate[::UPSAMPLING], torque[::UPSAMPLING], trace.keep.astype(float))
    found = equations(swing, trace.cutoff_hz)
    if found is None:
        return None
    x, y = found
    power = float(np.linalg.norm(y))
    added = np.array([trace.run.added_inertia_kg_m2, 0.0, 0.0])
    return _Run(x.T @ x / power**2, x.T @ y / power**2, added) if power > 0.0 else None


def _fit(runs: Sequence[_Run], signs: Array) -> Array:
    """J, C and K that all runs share, each torque with its sign."""
    a = np.sum([r.a for r in runs], axis=0)
    b = np.sum([s * r.b - r.a @ r.added for r, s in zip(runs, signs, strict=True)], axis=0)
    size = np.sqrt(np.maximum(np.diag(a), 1e-300))
    return np.asarray(np.linalg.pinv(a / np.outer(size, size), rcond=1e-9, hermitian=True) @ (b / size) / size)


def _left(run: _Run, sign: float, values: Array) -> float:
    """Share of a run's torque that is left."""
    own = values + run.added
    return float(1.0 - 2.0 * sign * run.b @ own + own @ run.a @ own)


def _best(runs: Sequence[_Run]) -> Array:
    """The signs that explain most, turned so that the platform is a possible one."""

    def left(signs: Array) -> float:
        values = _fit(runs, signs)
        return sum(_left(r, s, values) for r, s in zip(runs, signs, strict=True))

    if len(runs) <= MAX_EXHAUSTIVE_RUNS:
        best = min((np.array(way) for way in product((1.0, -1.0), repeat=len(runs))), key=left)
    else:
        best = np.ones(len(runs))
        for i in range(len(runs)):
            other = best.copy()
            other[i] = -1.0
            best = min((best, other), key=left)
    if any(np.any(r.added) for r in runs):
        return best  # a known mass tells a platform from its mirror image
    return best if _possible(runs, best) else -best


def _possible(runs: Sequence[_Run], signs: Array) -> bool:
    """Whether inertia and spring are positive with these signs; where they disagree, whether most runs are right."""
    inertia, _, stiffness = _fit(runs, signs)
    moving = np.sqrt(np.diag(np.sum([r.a for r in runs], axis=0)))  # torque of a unit of each
    small, large = sorted((inertia * moving[0], stiffness * moving[2]), key=abs)
    if small * large < 0.0 and abs(small) > MINOR * abs(large):
        return bool(np.sum(signs) >= 0.0)
    return bool(large > 0.0)
