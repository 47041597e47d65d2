"""What parameters, a run's own unknowns and the noise do to the innovations: the derivatives that a fit steps by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identify.likelihood.fit import Columns, Look
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.simulate.shots import RUNAWAY, Shots, moved
from rig.arrays import Array
from rig.dynamics.gains import Gains, Noise, innovations_with

if TYPE_CHECKING:
    from identify.likelihood.prediction_error import PredictionError

NOISE_STEP = 0.02  # of a logarithm of the noise, in its differences
BIAS_STEP, START_STEP = 1e-4, 1e-6  # of the motion, of a bias and of a start state


@dataclass(frozen=True)
class Standpoint:
    """A model with all its numbers, and every run predicted with them."""

    problem: PredictionError
    structure: Structure
    names: Sequence[Name]
    x: Array
    noise: Noise
    shots: Sequence[Shots]
    looks: Sequence[Look]


def derivatives(at: Standpoint, steps: Mapping[int, float], kinds: Sequence[str]) -> list[tuple[Columns, Array, Array]]:
    """Every run's derivatives; the predictions they need side by side, of all runs and parameters.

    Parameters
    ----------
    steps
        By which the parameters are moved that are free, by their place.
    kinds
        Numbers of the noise whose logarithms are moved, too.

    Returns
    -------
    For every run its columns, what the logarithms of the noise do to the scaled innovations, (n, k), and what to the
    logarithm of their variance, (n, k).
    """
    tasks = [
        (i, k) for i, s in enumerate(at.shots) for k in steps
        if len(at.names[k]) < 3 or int(at.names[k][2]) == s.number
    ]  # fmt: skip
    workers = at.problem.workers
    done = dict(zip(tasks, workers.map(lambda t: _by_parameter(at, t[0], t[1], steps[t[1]]), tasks), strict=True))
    return list(workers.map(lambda i: _of_run(at, i, done, kinds), range(len(at.shots))))


@RUNAWAY
def _by_parameter(at: Standpoint, i: int, k: int, step: float) -> Array:
    """What a parameter does to one run's scaled innovations, (n,)."""
    s, base, there = at.shots[i], at.looks[i], at.x.copy()
    w = s.weight
    there[k] += step
    # What a parameter does to the gains matters to no innovation that is white, and gains cost a prediction.
    other = at.problem.look(s, at.structure, at.names, there, at.noise, base.gains)
    return np.asarray(((base.innovations[w] - other.innovations[w]) / (step * np.sqrt(base.variance[w]))).ravel())


@RUNAWAY
def _of_run(
    at: Standpoint, i: int, done: Mapping[tuple[int, int], Array], kinds: Sequence[str]
) -> tuple[Columns, Array, Array]:
    """Derivatives of one run; ``done`` are those by parameters.

    The noise and the bias act through the linear part: no prediction is needed for theirs.
    """
    p, s, base = at.problem, at.shots[i], at.looks[i]
    w, spans = s.weight, [(a, b - 1) for a, b in s.edges]
    root = np.sqrt(base.variance[w])

    def followed(gains: Gains, h: float, bias: float = 0.0) -> Array:
        e = innovations_with(base.gains, gains, base.innovations, base.state, s.trace.keep, spans, bias)
        return np.asarray(((base.innovations[w] - e[w]) / (h * root)).ravel())

    scaled = (base.innovations[w] / root).ravel()
    columns = np.zeros((scaled.size, len(at.x)))
    pulled, spread = np.zeros((scaled.size, len(kinds))), np.zeros((scaled.size, len(kinds)))
    for k in range(len(at.x)):
        if (i, k) in done:
            columns[:, k] = done[(i, k)]
    own = np.zeros((scaled.size, 0))
    if s.trace.biased:
        h = BIAS_STEP * p.rate_rad_s
        own = followed(base.gains, h, h)[:, None]
    if p.fits_starts:
        own = np.column_stack([own, _by_start(at, s, base, root)])
    for k, kind in enumerate(kinds):
        changed = replace(at.noise, **{kind: getattr(at.noise, kind) * float(np.exp(NOISE_STEP))})
        gains = p.gains_at(s, at.structure, at.names, at.x, changed)
        pulled[:, k] = followed(gains, NOISE_STEP)
        spread[:, k] = (np.log(gains.variance[w] / base.variance[w]) / NOISE_STEP).ravel()
    return Columns(columns, own, scaled, base.variance[w].ravel()), pulled, spread


def _by_start(at: Standpoint, s: Shots, base: Look, root: Array) -> Array:
    """What angle and rate at the start of every stretch do to one run's scaled innovations, (n, 2 stretches)."""
    p, out = at.problem, []
    stretch = np.searchsorted(s.first, np.arange(len(s.weight)), side="right")[s.weight] - 1
    of_reading = np.repeat(stretch, p.readings)
    for which, size in enumerate((p.angle_rad, p.rate_rad_s)):
        h = np.array([0.0, 0.0])
        h[which] = START_STEP * size
        other = p.look(moved(s, (h, 0.0)), at.structure, at.names, at.x, at.noise, base.gains)
        change = ((base.innovations - other.innovations)[s.weight] / (h[which] * root)).ravel()
        out.append([np.where(of_reading == k, change, 0.0) for k in range(len(s.first))])
    return np.column_stack([column for pair in zip(*out, strict=True) for column in pair])
