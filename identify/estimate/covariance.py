"""Covariance of a fit by least squares, whose residual may be coloured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import signal

from identify.model.parameter_fit import ZERO_INFORMATION
from identify.simulate.sensitivities import INFORMATION_RCOND
from rig.recording.run import Array

BLOCKS_PER_RUN = 20  # blocks at most, over which scores scatter
ALIKE_BLOCKS = 3  # in a row that may be pulled alike
RESIDUAL_SEGMENT_SAMPLES = 256  # samples of a stretch whose spectrum is averaged


def _inverse(information: Array) -> tuple[Array, tuple[bool, ...]]:
    """Inverse of an information matrix and which parameters it determines."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    power, axes = np.linalg.eigh(information / np.outer(scale, scale))
    empty = power < INFORMATION_RCOND * max(power[-1], 1e-300)
    inverse = axes[:, ~empty] @ np.diag(1.0 / power[~empty]) @ axes[:, ~empty].T
    touched = np.any(np.abs(axes[:, empty]) > 0.05, axis=1) if np.any(empty) else np.zeros(len(scale), dtype=bool)
    dead = np.diag(information) <= ZERO_INFORMATION
    return inverse / np.outer(scale, scale), tuple(bool(x) for x in ~(touched | dead))


def orthogonal_part(own: Array, values: Array) -> Array:
    """Columns (n, m) without what a run's own unknowns, (n, k), can follow."""
    basis = own_basis(own)
    return np.asarray(values - basis @ (basis.T @ values)) if basis.shape[1] else values


def own_basis(own: Array) -> Array:
    """Orthonormal columns that a run's own unknowns, (n, k), can follow: (n, k), fewer where one does nothing."""
    size: Array = np.linalg.norm(own, axis=0)
    nonzero = size > 0.0
    return np.asarray(np.linalg.qr(own[:, nonzero] / size[nonzero])[0]) if np.any(nonzero) else own[:, :0]


def sandwich(parts: Sequence[tuple[Array, Array]], sigma: float) -> tuple[Array, Any]:
    """Covariance from every run's columns (m, p) and residual (m,): plain where the residual is white.

    Where it is coloured, scores of blocks carry what changes along a run, but are few; the residual's spectrum
    uses every sample, but takes the colour for the same all along. Each parameter gets the larger of the two.
    """
    information = np.sum([x.T @ x for x, _ in parts], axis=0)
    inverse, determined = _inverse(information)
    plain = inverse * sigma**2
    scores = np.concatenate(_block_scores(parts))
    m = len(scores)
    if is_white([r for _, r in parts]) or m < 3 * len(information):
        return plain, determined
    by_blocks = inverse @ (scores.T @ scores * m / (m - 1.0)) @ inverse
    by_spectrum = inverse @ np.sum([_coloured(x, r) for x, r in parts], axis=0) @ inverse
    ratio = np.diag(by_spectrum) / np.maximum(np.diag(by_blocks), 1e-300)
    wider = np.sqrt(np.maximum(1.0, ratio))
    return by_blocks * np.outer(wider, wider), determined


def _block_scores(parts: Sequence[tuple[Array, Array]]) -> list[Array]:
    """What every block of a run pulls the parameters by, (blocks, p) of every run."""
    return [
        np.array([
            x[part].T @ r[part] for part in np.array_split(np.arange(len(r)), min(BLOCKS_PER_RUN, max(len(r) // 50, 1)))
        ]) for x, r in parts
    ]  # fmt: skip


def score_scatter(parts: Sequence[tuple[Array, Array]]) -> Array:
    """By how many times standard errors are larger than the information says, (p,), at least one.

    Where a likelihood is right the scores of blocks scatter as their information says, each by itself. What it does not
    know of (a delay that wanders from second to second) shows in how they do, and in neighbours that are alike (White,
    Econometrica 50, 1982; Newey and West, Econometrica 55, 1987). One where there are too few blocks.

    Parameters
    ----------
    parts
        Every run's columns (m, p) and residual (m,) of unit variance.
    """
    information = np.sum([x.T @ x for x, _ in parts], axis=0)
    inverse, _ = _inverse(information)
    runs = _block_scores(parts)
    m = sum(len(scores) for scores in runs)
    if m < 3 * len(information):
        return np.ones(len(information))
    scatter = np.zeros_like(information)
    for scores in runs:
        scatter += scores.T @ scores
        for apart in range(1, min(ALIKE_BLOCKS, len(scores))):
            both = scores[apart:].T @ scores[:-apart]
            scatter += (1.0 - apart / ALIKE_BLOCKS) * (both + both.T)
    seen = np.diag(inverse @ (scatter * m / (m - 1.0)) @ inverse)
    return np.asarray(np.sqrt(np.maximum(1.0, seen / np.maximum(np.diag(inverse), 1e-300))))


def covariance_of(parts: Sequence[tuple[Array, Array]], fitted: int) -> tuple[Array, tuple[bool, ...]]:
    """Covariance of least squares from every run's columns (m, p) and residual (m,), coloured or not."""
    covariance, determined = sandwich(parts, rms_of(parts, fitted))
    return covariance, tuple(determined)


def _coloured(columns: Array, residual: Array) -> Array:
    """Variance of the scores of one run where its residual is stationary, (p, p): columns weighed by its spectrum."""
    n = len(residual)
    f, power = signal.welch(residual, nperseg=min(n, RESIDUAL_SEGMENT_SAMPLES), detrend=False)
    transformed = np.fft.rfft(columns, 2 * n, axis=0)
    level = np.interp(np.fft.rfftfreq(2 * n), f[1:-1], 0.5 * power[1:-1])  # two-sided
    weight = level * np.where(np.arange(n + 1) % n == 0, 1.0, 2.0) / (2 * n)
    return np.asarray(np.real(np.conj(transformed).T @ (transformed * weight[:, None])))


def is_white(series: Sequence[Array]) -> bool:
    """Whether the first autocorrelations of a residual are no larger than chance makes them."""
    num, den, count = np.zeros(8), 0.0, 0
    for values in series:
        if len(values) < 9:
            continue
        r = values - np.mean(values)
        num += np.array([float(r[k:] @ r[:-k]) for k in range(1, 9)])
        den += float(r @ r)
        count += len(r)
    rho = num / max(den, 1e-300)
    return bool(np.all(np.abs(rho) < 4.0 / np.sqrt(max(count, 1)) + 0.01))


def rms_of(parts: Sequence[tuple[Array, Array]], fitted: int) -> float:
    """Root mean square residual, ``fitted`` degrees of freedom taken off."""
    count = sum(len(r) for _, r in parts)
    return float(np.sqrt(sum(float(r @ r) for _, r in parts) / max(count - fitted, 1)))
