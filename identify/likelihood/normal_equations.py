"""The normal equations of a step: parameters and noise together, what each run has of its own eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from identify.likelihood.derivatives import Derivatives
from identify.simulate.shots import Shots, moved, with_bias
from rig.arrays import Array


@dataclass(frozen=True)
class Floor:
    """Least variance of one reading.

    Attributes
    ----------
    variance
        It.
    falls
        By how much its logarithm falls with the parameters and the logarithms of the noise, (p + k,).
    """

    variance: float
    falls: Array

    def variance_of(self, squares: float, count: int) -> tuple[float, bool]:
        """Of one reading whose ``count`` scaled innovations have these squares, and whether they decide it."""
        found = squares / max(count, 1)
        return max(found, self.variance), found > self.variance


NORMAL_RCOND = 1e-9  # of the largest singular value of a scaled normal matrix
COST_TOLERANCE = 0.5  # fall of the cost below which a fit has arrived
MAX_LOG_STEP = 4.0  # by which a logarithm of the noise may fall in one step
MAX_NOISE_FACTOR = 1e12  # times itself, that a number of the noise may become in one step


@dataclass(frozen=True)
class Step:
    """What a step is solved from: normal matrix and right side, and how each run's own unknowns follow."""

    matrix: Array
    right: Array
    information: Array  # of the parameters alone, for readings of unit variance, (p, p)
    own: Sequence[tuple[Array, Array]]  # (k, p) and (k,): what they lose with a change, and take without one
    level: Array  # by how much the variance of one reading falls with the logarithms of the noise, (k,)
    promised: float  # by how much the cost falls with what the runs' own unknowns take


def level_of(parts: Sequence[Derivatives], count: int, floor: Floor) -> tuple[float, Array]:
    """The variance of one reading, and by how much it falls with parameters and noise, (p + k,).

    Where it stands at the sensor's floor it falls as that does: then every variance tells, not only how they differ.
    """
    squares = sum(float(d.columns.scaled @ d.columns.scaled) for d in parts)
    variance, free = floor.variance_of(squares, count)
    return variance, np.sum([d.spread.sum(axis=0) for d in parts], axis=0) / max(count, 1) if free else floor.falls


def normal_equations(
    parts: Sequence[Derivatives], p: int, k: int, count: int, floor: Floor
) -> Step:  # fmt: skip
    """Of ``p`` parameters and ``k`` numbers of the noise, from every run's derivatives.

    ``count`` is the number of readings that count.
    """
    matrix, right = np.zeros((p + k, p + k)), np.zeros(p + k)
    information, own, promised = np.zeros((p, p)), [], 0.0
    variance, level = level_of(parts, count, floor)
    for d in parts:
        z, wide = d.columns.scaled, d.pulled.copy()
        wide[:, :p] += d.columns.columns
        basis, follow = _spanned(d.columns.own)
        across, taken = basis.T @ wide, basis.T @ z
        matrix += (wide.T @ wide - across.T @ across) / variance
        right += (wide.T @ z - across.T @ taken) / variance
        own.append((follow @ across, follow @ taken))
        promised += float(taken @ taken) / variance
        steady = basis.T @ d.columns.columns
        information += d.columns.columns.T @ d.columns.columns - steady.T @ steady
        apart = d.spread - level  # where the scale of all variances is free, only what differs between samples tells
        matrix += 0.5 * apart.T @ apart
        right -= 0.5 * apart.T @ (1.0 - z * z / variance)
    return Step(matrix, right, information, own, level[p:], promised)


def _spanned(own: Array) -> tuple[Array, Array]:
    """An orthonormal basis of what a run's own unknowns do, (n, r), and the unknowns for each of it, (k, r)."""
    size = np.linalg.norm(own, axis=0)
    nonzero = np.flatnonzero(size > 0.0)
    follow = np.zeros((own.shape[1], len(nonzero)))
    if not len(nonzero):
        return own[:, nonzero], follow
    basis, upper = np.linalg.qr(own[:, nonzero] / size[nonzero])
    inverse = np.linalg.pinv(upper, rcond=1e-12)
    follow[nonzero] = inverse / size[nonzero, None]
    return basis, follow


def bounded_step(matrix: Array, right: Array, low: Array, high: Array) -> Array:
    """The change within bounds that lowers the cost most, by ``matrix`` (n, n) and ``right`` (n,).

    What would go beyond a bound is held there and the others are solved for beside it, but which are to be held is
    searched (bounded least squares: Stark and Parker 1995). Of two numbers that do nearly the same, as the size of
    a disturbance and its time constant, one may run to a bound by what the other takes back.
    """
    step, free = np.zeros(len(right)), high > low
    part = matrix[np.ix_(free, free)]
    step[free] = np.linalg.lstsq(part, right[free], rcond=NORMAL_RCOND)[0]
    if np.all((step >= low) & (step <= high)):
        return step
    values, vectors = np.linalg.eigh(part)
    regular = values > NORMAL_RCOND * max(float(values[-1]), 0.0)
    root, along = np.sqrt(values[regular]), vectors[:, regular].T
    found = lsq_linear(root[:, None] * along, (along @ right[free]) / root, (low[free], high[free]), "bvls")
    step[free] = np.clip(found.x, low[free], high[free])
    return step


def logs_of(step: Array, level: Array, ratios: Sequence[bool]) -> Array:
    """What a step in the logarithms of the noise comes to, (k,).

    A density far below its best hardly acts: the cost is a straight line in the density itself, not in its logarithm.
    So what rises is stepped as a density (1 + step times itself), what falls as a logarithm. That holds for what each
    density is; as ``ratios`` to the variance of a reading, which falls by ``level`` a unit, they may all rise together
    where only that variance falls.
    """
    with_variance = np.asarray(ratios, dtype=bool)
    variance = -float(level @ step)
    bare = step + np.where(with_variance, variance, 0.0)
    return _stepped(bare) - np.where(with_variance, _stepped(np.array(variance)), 0.0)


def _stepped(step: Array) -> Array:
    return np.where(step > 0.0, np.log1p(np.clip(step, 0.0, MAX_NOISE_FACTOR)), np.maximum(step, -MAX_LOG_STEP))


def changed(s: Shots, own: Array) -> Shots:
    """The same run with its own unknowns changed: its bias, if it has one, and its start states, if they are fitted.

    Where a cut stretch begins, a bias that may walk is hardly known, and would carry the angle off by radians.
    """
    biased = int(s.trace.biased)
    starts = own[biased:].reshape(-1, 2)
    most = s.trace.largest_bias_rad_s
    bias = min(max(s.bias + float(own[0]), -most), most) if biased else 0.0
    if len(starts):
        return moved(s, (starts, bias - s.bias if biased else 0.0))
    return with_bias(s, bias) if biased else s
