"""What parameters, a run's own unknowns and the noise do to the innovations: the derivatives that a fit steps by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identify.likelihood.fit import Columns, Look
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.simulate.shots import RUNAWAY, Shots, moved, with_bias
from rig import effects
from rig.arrays import Array
from rig.dynamics.gains import Gains, Noise, innovations_with

if TYPE_CHECKING:
    from identify.likelihood.prediction_error import PredictionError

NOISE_STEP = 0.02  # of a logarithm of the noise, in its differences
GAIN_STEP = 0.02  # of a parameter's scale, in differences of gains: those are cut off where they have settled
RUNAWAY_SIGMAS = 1e6  # standard deviations that innovations move by with a step: gains that follow no motion
MOTION_STEP = 1e-6  # of the motion, for a bias and for a start state: a bias turns the angle far in a long run


@dataclass(frozen=True)
class OperatingPoint:
    """A model with all its numbers, and every run predicted with them."""

    problem: PredictionError
    structure: Structure
    names: Sequence[Name]
    x: Array
    noise: Noise
    shots: Sequence[Shots]
    looks: Sequence[Look]


@dataclass(frozen=True)
class Derivatives:
    """One run's derivatives: of the prediction, and of the gains behind it.

    Attributes
    ----------
    columns
        What the parameters do to the scaled innovations with gains that stay.
    pulled
        What parameters and logarithms of the noise do through the gains, (n, p + k).
    spread
        What they do to the logarithm of the innovations' variance, (n, p + k).
    """

    columns: Columns
    pulled: Array
    spread: Array

    def with_variance(self, level: Array, variance: float) -> Columns:
        """Columns whose products are those of the whole likelihood: after every innovation, what its variance tells.

        A variance tells as much as half a squared unit normal does. ``level`` is the mean of ``spread`` over all runs,
        (p,), for the scale of all variances is free; ``variance`` that of the scaled innovations.
        """
        c, root = self.columns, np.sqrt(0.5 * variance)
        p = c.columns.shape[1]

        def between(innovations: Array, variances: Array) -> Array:
            return np.stack([innovations, variances], axis=1).reshape(2 * len(innovations), *innovations.shape[1:])

        return Columns(
            between(c.columns + self.pulled[:, :p], root * (self.spread[:, :p] - level[:p])),
            between(c.own, np.zeros_like(c.own)), between(c.scaled, root * (c.scaled**2 / variance - 1.0)),
            np.repeat(c.variance, 2),
        )  # fmt: skip


def derivatives(
    at: OperatingPoint,
    steps: Mapping[int, float],
    kinds: Sequence[str],
    through_gains: Mapping[int, float] | None = None,
) -> list[Derivatives]:
    """Every run's derivatives; the predictions they need side by side, of all runs and parameters.

    Parameters
    ----------
    steps
        By which the parameters are moved that are free, by their place.
    kinds
        Numbers of the noise whose logarithms are moved, too.
    through_gains
        Steps of the parameters whose effect on the gains counts, by their place. Beside the right model it averages
        out in the innovations, and the information of the parameters does without it; but not in their variance. The
        lag of a gyro shapes the noise that came before it, and a step that does not know of that goes astray.
    """
    tasks = [
        (i, k) for i, s in enumerate(at.shots) for k in steps
        if len(at.names[k]) < 3 or int(at.names[k][2]) == s.number
    ]  # fmt: skip
    workers = at.problem.workers
    done = dict(zip(tasks, workers.map(lambda t: _by_parameter(at, t[0], t[1], steps[t[1]]), tasks), strict=True))
    return list(workers.map(lambda i: _of_run(at, i, done, kinds, through_gains or {}), range(len(at.shots))))


@RUNAWAY
def _by_parameter(at: OperatingPoint, i: int, k: int, step: float) -> Array:
    """What a parameter does to one run's scaled innovations, (n,)."""
    s, base, there = at.shots[i], at.looks[i], at.x.copy()
    w = s.weight
    there[k] += step
    other = at.problem.look(s, at.structure, at.names, there, at.noise, base.gains)
    return np.asarray(((base.innovations[w] - other.innovations[w]) / (step * np.sqrt(base.variance[w]))).ravel())


@RUNAWAY
def _of_run(
    at: OperatingPoint, i: int, done: Mapping[tuple[int, int], Array], kinds: Sequence[str],
    through_gains: Mapping[int, float],
) -> Derivatives:  # fmt: skip
    """Derivatives of one run; ``done`` are those by parameters with gains that stay.

    Noise and bias act on a linear platform alike wherever it stands, and no prediction is needed for theirs. Where a
    gap, a stop or dry friction bends the motion, what they do depends on where it is: those are predicted. What J, C
    and K do through the gains is little beside what they do themselves, and is followed along the linear part always.
    """
    p, s, base = at.problem, at.shots[i], at.looks[i]
    w, spans = s.weight, [(a, b - 1) for a, b in s.edges]
    root = np.sqrt(base.variance[w])
    bends = at.structure.acts_on_motion

    def followed(gains: Gains, h: float, bias: float = 0.0, predict: bool = bends) -> Array:
        if predict:
            e = p.look(with_bias(s, s.bias + bias), at.structure, at.names, at.x, at.noise, gains).innovations
        else:
            e = innovations_with(base.gains, gains, base.innovations, base.state, s.trace.keep, spans, bias)
        return np.asarray(((base.innovations[w] - e[w]) / (h * root)).ravel())

    scaled = (base.innovations[w] / root).ravel()
    columns = np.zeros((scaled.size, len(at.x)))
    count = len(at.x) + len(kinds)
    pulled, spread = np.zeros((scaled.size, count)), np.zeros((scaled.size, count))
    for k in range(len(at.x)):
        if (i, k) in done:
            columns[:, k] = done[(i, k)]
    own = np.zeros((scaled.size, 0))
    if s.trace.biased:
        h = MOTION_STEP * p.rate_rad_s
        # Where a stretch begins within a run, its start angle goes with the bias.
        own = followed(base.gains, h, h, predict=bends or bool(np.any(s.since_s > 0.0)))[:, None]
    if p.fits_starts:
        own = np.column_stack([own, _by_start(at, s, base, root)])
    for k, step in through_gains.items():
        there = at.x.copy()
        there[k] += step
        # The states of a sensor's low-pass are corrected, and pass that on.
        if len(at.names[k]) > 1 and effects.get(at.names[k][0]).lag is not None:
            other = p.look(s, at.structure, at.names, there, at.noise)
            change = ((base.innovations[w] - other.innovations[w]) / (step * root)).ravel()
            pulled[:, k], gains = change - columns[:, k], other.gains
        else:
            gains = p.gains_at(s, at.structure, at.names, there, at.noise)
            pulled[:, k] = followed(replace(base.gains, gain=gains.gain, variance=gains.variance), step, predict=False)
        spread[:, k] = (np.log(gains.variance[w] / base.variance[w]) / step).ravel()
        far = float(np.max(np.abs(step * pulled[:, k]), initial=0.0))
        if not (far < RUNAWAY_SIGMAS and np.all(np.isfinite(spread[:, k]))):
            pulled[:, k] = spread[:, k] = 0.0  # the linear part runs away there: its gains tell nothing
    for k, kind in enumerate(kinds, len(at.x)):
        changed = replace(at.noise, **{kind: getattr(at.noise, kind) * float(np.exp(NOISE_STEP))})
        gains = p.gains_at(s, at.structure, at.names, at.x, changed)
        pulled[:, k] = followed(gains, NOISE_STEP)
        spread[:, k] = (np.log(gains.variance[w] / base.variance[w]) / NOISE_STEP).ravel()
    return Derivatives(Columns(columns, own, scaled, base.variance[w].ravel()), pulled, spread)


def _by_start(at: OperatingPoint, s: Shots, base: Look, root: Array) -> Array:
    """What angle and rate at the start of every stretch do to one run's scaled innovations, (n, 2 stretches)."""
    p, out = at.problem, []
    stretch = np.searchsorted(s.first, np.arange(len(s.weight)), side="right")[s.weight] - 1
    of_reading = np.repeat(stretch, p.readings)
    for which, size in enumerate((p.angle_rad, p.rate_rad_s)):
        h = np.array([0.0, 0.0])
        h[which] = MOTION_STEP * size
        other = p.look(moved(s, (h, 0.0)), at.structure, at.names, at.x, at.noise, base.gains)
        change = ((base.innovations - other.innovations)[s.weight] / (h[which] * root)).ravel()
        out.append([np.where(of_reading == k, change, 0.0) for k in range(len(s.first))])
    return np.column_stack([column for pair in zip(*out, strict=True) for column in pair])
