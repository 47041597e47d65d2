"""By how much one of two models of the same samples is likelier, as far as blocks of the record agree on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_toeplitz

from identify.likelihood.fit import Fit
from rig import effects
from rig.arrays import Array

EVIDENCE_BLOCKS = 30  # of all runs together, over which scores scatter: their ratio is then known to a quarter
ROUNDING = 1e-9  # of a block's own scatter, that a line always leaves
DIFFERENCE_VARIANCE = 4.0  # of a difference of two costs over its mean, where one of the models is right
ORDER_PER_DECADE = 10  # of an autoregression, for every decade of samples (the usual rule)


def support_difference(one: Fit, other: Fit) -> float:
    """By how much another model on the same samples is likelier, as far as that can be believed; zero if it is not.

    The smaller of two numbers: the fall of the penalised cost, and the square of the standard errors by which blocks of
    the record agree on it. That asks nothing of either model but that blocks are alike; those of a decay are not: the
    first ones tell nearly all. Of two lags or delays, the fall is no more than is left of it once the innovations of
    both are whitened: a low-pass shapes the noise as well, and where that has a colour no model of it has, the one with
    the wrong form may come closer to it.
    """
    fall = one.penalised - other.penalised
    if fall <= 0.0:
        return 0.0
    if all(s.trace.torque is None for s in one.shots) or not np.isfinite(fall):  # the one runs away
        return fall
    price = (one.penalised - one.cost) - (other.penalised - other.cost)
    if _lags(one) != _lags(other):
        fall = min(fall, max(_whitened_cost(one) - _whitened_cost(other) + price, 0.0))
    return min(fall, agreement(block_costs(one) - block_costs(other), block_divergences(one, other), price) ** 2)


def agreement(falls: Array, apart: Array, price: float = 0.0) -> float:
    """Standard errors by which blocks agree that their costs fall together; zero if they do not.

    A block can tell two models apart as far as their predictions differ in it, which is known of every block
    (``apart``): five of thirty may tell all. If one of the models is right, the costs there differ by that much on
    average, with four times that for a variance. Where neither is right they scatter more, about a line over it (as in
    Vuong 1989, about a mean): two models that differ in their noise alone differ as much in every block. No
    single block decides, in which one of the models may happen to fail: the one that speaks most for the other model
    and the one that does most against it are left out.

    Parameters
    ----------
    falls, apart
        Of every block, (b,).
    price
        What they have to pay together.
    """
    each = falls + price * apart / max(float(np.sum(apart)), 1e-300)
    between = np.argsort(each)[1:-1]
    each, apart = each[between], apart[between]
    fall, whole = float(np.sum(each)), float(np.sum(apart))
    if not (fall > 0.0 and whole > 0.0):
        return 0.0
    line = np.linalg.qr(np.column_stack([np.ones(len(each)), apart]))[0]
    free = 1.0 - np.sum(line * line, axis=1)  # of a block's own, that the line does not take
    scatter = float(np.sum((each - line @ (line.T @ each)) ** 2 / np.maximum(free, ROUNDING)))
    return fall / float(np.sqrt(max(scatter, DIFFERENCE_VARIANCE * whole)))


def block_costs(fit: Fit) -> Array:
    """What blocks of the record add to the cost of a fit, (b,)."""
    return _by_block(fit.prediction.costs, fit)


def block_divergences(one: Fit, other: Fit) -> Array:
    """How far apart two models' predictions lie in blocks of the record, (b,).

    The mean difference of their costs where the one is right, and where the other is (Jeffreys 1946).
    """
    mine, theirs = one.prediction, other.prediction
    apart = []
    for e, f, v, w in zip(mine.innovations, theirs.innovations, mine.variance, theirs.variance, strict=True):
        ratio = v * one.variance / (w * other.variance)
        squares = (e - f) ** 2 * (1.0 + ratio) / (v * one.variance)
        apart.append(np.sum(0.5 * (squares + ratio + 1.0 / ratio - 2.0), axis=1))
    return _by_block(apart, one)


def _lags(fit: Fit) -> set[str]:
    """Its lags and delays, of sensor and drive."""
    return {e for e in fit.structure.effects if effects.get(e).is_late}


def _whitened_cost(fit: Fit) -> float:
    """Minus twice the log-likelihood with innovations that follow an autoregression, up to a constant of the samples.

    Both readings of a sample have an autoregression each (Yule-Walker).
    """
    total, p = 0.0, fit.prediction
    count = sum(int(np.sum(s.weight)) for s in fit.shots)
    order = int(ORDER_PER_DECADE * np.log10(max(count, 10)))
    for m in range(p.innovations[0].shape[1]):
        products = np.zeros(order + 1)
        for e, v, s in zip(p.innovations, p.variance, fit.shots, strict=True):
            scaled = np.where(s.weight, e[:, m] / np.sqrt(v[:, m]), 0.0)
            for a, b in s.edges:
                x = scaled[a:b]
                products[: b - a] += [x[k:] @ x[: len(x) - k] for k in range(min(order + 1, b - a))]
            total += float(np.sum(np.log(v[s.weight, m])))
        left = products[0] - products[1:] @ solve_toeplitz(products[:-1], products[1:])
        total += count * float(np.log(left / count))
    return total


def _by_block(each: Sequence[Array], fit: Fit) -> Array:
    """Sums over blocks of the record of what every sample adds, of those that count."""
    number = max(1, round(EVIDENCE_BLOCKS / len(each)))
    parts = [np.array_split(of_run[s.weight], number) for of_run, s in zip(each, fit.shots, strict=True)]
    return np.array([float(np.sum(part)) for run in parts for part in run])
