"""Least squares with bounds and a coloured residual, and the lines in it: the arithmetic behind a search in torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import chi2, norm
from scipy.stats import t as student

from rig.arrays import Array

AUTOREGRESSION_ORDER = 24  # of the autoregression: six periods of the cut-off, at four samples each
AUTOREGRESSION_ROUNDS = 3  # of fitting the autoregression and the parameters in turn
MIN_ERROR_RATE = 1e-12  # below it a rate of error tells nothing: neither test is exact that far out
MAX_LINES_IN_RUN = 4  # that are looked for in a run


def lines(x: Array, values: Array, highest: float) -> list[tuple[float, float]]:
    """Size and frequency of the strongest lines of a signal that is read at places in ascending order."""
    even = np.linspace(x[0], x[-1], len(x))
    window = np.interp(even, x, values) * np.hanning(len(x))
    size = np.abs(np.fft.rfft(window, 4 * len(x))) / np.sqrt(len(x))
    f = np.arange(len(size)) / (4.0 * len(x)) * (len(x) - 1) / max(float(x[-1] - x[0]), 1e-300)
    inside = (f > 1.5 / max(float(x[-1] - x[0]), 1e-300)) & (f < highest)
    peaks = find_peaks(size * inside)[0]
    return [(float(size[k]), float(f[k])) for k in peaks[np.argsort(size[peaks])[-MAX_LINES_IN_RUN:]]]


def strongest(found: list[tuple[float, float]]) -> tuple[float, ...]:
    return tuple(f for _, f in sorted(found, reverse=True)[: 2 * MAX_LINES_IN_RUN])


def standard_errors(values: Sequence[float] | Array) -> float:
    """By how many of its standard errors an average lies above zero."""
    return float(np.mean(values) / max(float(np.std(values, ddof=1)), 1e-300) * np.sqrt(len(values)))


def combined(groups: Sequence[Array]) -> float:
    """The same of several groups of values of which only some may lie above zero, in standard errors."""
    enough = [g for g in groups if len(g) > 1]
    rates = [float(student.sf(standard_errors(g), len(g) - 1)) for g in enough]
    rate = float(chi2.sf(-2.0 * np.sum(np.log(np.maximum(rates, MIN_ERROR_RATE))), 2 * len(rates))) if rates else 1.0
    return float(norm.isf(max(rate, MIN_ERROR_RATE)))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def bounded(normal: Array, right_side: Array, low: Array) -> Array:
    """Least squares from normal equations with lower bounds: what would go below is held at its bound."""
    if not (np.all(np.isfinite(normal)) and np.all(np.isfinite(right_side))):
        return np.zeros(len(right_side))  # an effect that ran away along a noisy motion explains nothing
    none = np.diag(normal) <= 0.0  # no sample knows of it: rounding, divided by its size, would be anything
    size = np.where(none, 1.0, np.sqrt(np.maximum(np.diag(normal), 1e-300)))
    normal, right_side = normal / np.outer(size, size), right_side / size
    bound = np.where(none, 0.0, np.where(np.isfinite(low), low * size, -np.inf))
    held = none.copy()
    x = np.zeros(len(right_side))
    for _ in range(len(right_side) + 1):
        free = ~held
        x[held] = bound[held]
        if not np.any(free):
            break
        right = right_side[free] - normal[np.ix_(free, held)] @ x[held]
        x[free] = np.linalg.lstsq(normal[np.ix_(free, free)], right, rcond=1e-12)[0]
        wrong = free & (x < bound)
        if not np.any(wrong):
            break
        held |= wrong
    return np.asarray(x / size)


def coloured_cost(columns: Array, target: Array, run: Array, gains: Array, given: Array | None) -> tuple[float, Array]:
    """Minus twice the log-likelihood with an autoregressive residual, parameters refitted behind its filter once."""
    residual = target - columns @ gains
    order = min(AUTOREGRESSION_ORDER, len(residual) // 50)
    if order < 1:
        return float(len(residual) * np.log(max(float(np.mean(residual * residual)), 1e-300))), np.ones(1)
    filters = autoregression(residual, run, order) if given is None else given
    order = len(filters) - 1

    members = [np.flatnonzero(run == k) for k in np.unique(run)]

    def whitened(m: Array) -> Array:
        out = []
        for one in members:
            part = m[one]
            if len(part) <= order:
                continue
            left = filters[0] * part[order:]
            term = np.empty_like(left)
            for i in range(1, order + 1):
                left += np.multiply(part[order - i : len(part) - i], filters[i], out=term)
            out.append(left)
        return np.concatenate(out)

    best = np.inf
    for _ in range(1 if given is not None else AUTOREGRESSION_ROUNDS):
        e = whitened(target)
        if columns.shape[1]:
            w = np.column_stack([whitened(columns[:, k]) for k in range(columns.shape[1])])
            size = np.linalg.norm(w, axis=0)
            size = np.where(size > 0.0, size, 1.0)
            gains = np.linalg.lstsq(w / size, e, rcond=1e-9)[0] / size
            e = e - w @ gains
        cost = float(len(e) * np.log(max(float(np.mean(e * e)), 1e-300)))
        if cost < best:
            best, kept = cost, filters
        if given is None:
            filters = autoregression(target - columns @ gains, run, order)
    return best, kept


def autoregression(residual: Array, run: Array, order: int) -> Array:
    """Coefficients of the filter that whitens a residual, (order + 1,), the first one."""
    past, now = [], []
    for k in np.unique(run):
        part = residual[run == k]
        if len(part) > order:
            past.append(np.column_stack([part[order - i : len(part) - i] for i in range(1, order + 1)]))
            now.append(part[order:])
    p, n = np.concatenate(past), np.concatenate(now)
    g = p.T @ p + 1e-9 * float(n @ n) * np.eye(order)
    return np.concatenate([[1.0], -np.linalg.lstsq(g, p.T @ n, rcond=1e-12)[0]])
