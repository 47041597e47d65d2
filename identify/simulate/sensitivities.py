"""Sensitivities of a simulated run, and normal equations with start states and bias eliminated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numba as nb
import numpy as np

from identify.model.parameters import Name, bounds_of, equations_of
from identify.model.structure import Structure
from identify.simulate.linearisation import Neighbourhood, neighbourhood_of
from identify.simulate.shots import RUNAWAY, Shots, losses_of, predict
from rig.dynamics import Equations
from rig.recording.run import Array

INFORMATION_RCOND = 1e-11  # smallest over largest eigenvalue of the scaled information: differences see no less
STEP = 1e-6  # relative step of the differences: simulations repeat to 1e-13
STUCK = 0.05  # of what a start rate shows on a free platform: one that shows less is taken up by friction


@dataclass
class Reduced:
    """One run's share of the normal equations; start states and bias eliminated, with the way back.

    ``columns`` and ``state`` are the sensitivities behind it.
    """

    a: Array
    b: Array
    losses: Array
    counts: Array
    back: Callable[[Array], tuple[Array, float]]
    columns: Array
    state: Array


def linearise(
    shots: Shots, structure: Structure, names: Sequence[Name], x: Array, scale: Array, fixed: Any, outlier: float
) -> Reduced:
    """Normal equations of one run around a parameter vector."""
    columns, state, residual = sensitivities(shots, structure, names, x, scale, fixed)
    return _eliminate(shots, columns, state, residual, shots.trace.biased, outlier)


def at_residual(part: Reduced, shots: Shots, residual: Array, outlier: float) -> Reduced:
    """The normal equations a little further on: a new residual, the sensitivities as they were."""
    return _eliminate(shots, part.columns, part.state, residual, shots.trace.biased, outlier)


@RUNAWAY
def jacobian(shots: Shots, structure: Structure, names: Sequence[Name], x: Array) -> tuple[Array, Array]:
    """Sensitivities and residual of the samples that count, start states and bias projected out: (m, p), (m,)."""
    scale = np.where(np.abs(x) > 0, np.abs(x), 1.0)
    still = np.zeros(len(names), dtype=bool)
    columns, state, residual = sensitivities(shots, structure, names, x, scale, still)
    parts = []
    for begin, end in shots.edges:
        mask = shots.weight[begin:end]
        if not np.any(mask):
            continue
        ones = [np.ones(int(mask.sum()))] if shots.trace.biased else []
        both = np.column_stack([columns[begin:end][mask], *ones, residual[begin:end][mask]])
        q = np.linalg.qr(state[begin:end][mask])[0]
        parts.append(both - q @ (q.T @ both))
    both = np.concatenate(parts)
    if shots.trace.biased:
        one = both[:, -2] / np.linalg.norm(both[:, -2])
        both = np.delete(both - np.outer(one, one @ both), -2, axis=1)
    return both[:, :-1], both[:, -1]


def nuisance_basis(shots: Shots, state: Array) -> Array:
    """Orthonormal basis of what start states (two a shot) and bias add to the samples that count, (m, nuisances)."""
    columns = []
    for begin, end in shots.edges:
        block = np.zeros_like(state)
        block[begin:end] = state[begin:end]
        columns += list(block[shots.weight].T)
    if shots.trace.biased:
        columns.append(np.ones(int(shots.weight.sum())))
    lengths = [float(np.linalg.norm(c)) for c in columns]
    kept = [c / size for c, size in zip(columns, lengths, strict=True) if size > 0.0]
    return np.asarray(np.linalg.qr(np.stack(kept, axis=1))[0]) if kept else np.zeros((int(shots.weight.sum()), 0))


@RUNAWAY
def sensitivities(
    shots: Shots, structure: Structure, names: Sequence[Name], x: Array, scale: Array, fixed: Any,
    near: Neighbourhood | None = None,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Derivatives by the parameters (n, p) and by the shots' start states (n, 2), and the residual (n,).

    ``near`` is the run's neighbourhood at ``x``, where somebody has it already.
    """

    def run(values: Array, starts: Array) -> Array:
        return predict(shots, equations_of(structure, names, values, shots.number, shots.added), starts, shots.bias)

    equations = equations_of(structure, names, x, shots.number, shots.added)
    near = near or neighbourhood_of(shots, equations)
    base = run(x, shots.starts) if near is None else near.channel
    residual = shots.trace.measured - base
    columns = np.zeros((len(base), len(x)))
    for i in range(len(x)):
        if fixed[i] or (len(names[i]) == 3 and int(names[i][2]) != shots.number):
            continue
        h = STEP * scale[i]
        _low, high = bounds_of(names[i])
        h = -h if x[i] + h > high else h
        moved = x.copy()
        moved[i] += h
        other = None if near is None else near.changed(equations_of(structure, names, moved, shots.number, shots.added))
        columns[:, i] = (run(moved, shots.starts) - base if other is None else other) / h
    span = np.maximum(np.max(np.abs(shots.trace.fine[0])), 1e-9), np.maximum(np.max(np.abs(shots.trace.fine[1])), 1e-9)
    state = np.zeros((len(base), 2))
    for k in range(2):
        if near is not None:
            state[:, k] = near.begun(k)
            continue
        moved = shots.starts.copy()
        moved[:, k] += STEP * 10.0 * span[k]
        state[:, k] = (run(x, moved) - base) / (STEP * 10.0 * span[k])
    if shots.rests:
        begin, end = shots.edges[0]
        state[begin:end] = 0.0
    if equations.sticks:
        _without_stuck_rates(shots, state, equations)
    return columns, state, residual


def _without_stuck_rates(s: Shots, state: Array, equations: Equations) -> None:
    """Take out start rates that lead nowhere, in place: a platform that begins stuck shows its angle alone.

    What friction leaves of a push would call for a huge one; a free platform turns it into an angle of rate / w0.
    """
    inertia, _, stiffness = equations.jck.tolist()
    if stiffness <= 0.0:
        return
    for begin, end in s.edges:
        used = s.weight[begin:end]
        by_angle, by_rate = (float(np.linalg.norm(state[begin:end, k][used])) for k in range(2))
        if by_rate < STUCK * by_angle * float(np.sqrt(inertia / stiffness)):
            state[begin:end, 1] = 0.0


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _schur(wide, state, residual, used, edges, trust):  # type: ignore[no-untyped-def]
    """Normal equations with every shot's two start states eliminated, and what leads back to them."""
    q, shots = wide.shape[1], len(edges)
    a, b = np.zeros((q, q)), np.zeros(q)
    inverse, zw, zr = np.zeros((shots, 2, 2)), np.zeros((shots, 2, q)), np.zeros((shots, 2))
    ww, wr = np.zeros((q, q)), np.zeros(q)
    for s in range(shots):
        ww[:], wr[:] = 0.0, 0.0
        z00, z01, z11 = 0.0, 0.0, 0.0
        for i in range(edges[s, 0], edges[s, 1]):
            if not used[i]:
                continue
            r, u, v = residual[i], state[i, 0], state[i, 1]
            z00 += u * u
            z01 += u * v
            z11 += v * v
            zr[s, 0] += u * r
            zr[s, 1] += v * r
            for j in range(q):
                x = wide[i, j]
                zw[s, 0, j] += u * x
                zw[s, 1, j] += v * x
                wr[j] += x * r
                for k in range(j + 1):
                    ww[j, k] += x * wide[i, k]
        det = z00 * z11 - z01 * z01
        if det > 1e-12 * z00 * z11:
            inverse[s, 0, 0], inverse[s, 1, 1] = z11 / det, z00 / det
            inverse[s, 0, 1] = inverse[s, 1, 0] = -z01 / det
        else:  # only one of them shows
            inverse[s, 0, 0] = 1.0 / z00 if z00 >= z11 and z00 > 0.0 else 0.0
            inverse[s, 1, 1] = 1.0 / z11 if z11 > z00 else 0.0
        for j in range(q):
            ij0 = inverse[s, 0, 0] * zw[s, 0, j] + inverse[s, 0, 1] * zw[s, 1, j]
            ij1 = inverse[s, 1, 0] * zw[s, 0, j] + inverse[s, 1, 1] * zw[s, 1, j]
            b[j] += trust[s] * (wr[j] - ij0 * zr[s, 0] - ij1 * zr[s, 1])
            for k in range(j + 1):
                a[j, k] += trust[s] * (ww[j, k] - ij0 * zw[s, 0, k] - ij1 * zw[s, 1, k])
    for j in range(q):
        for k in range(j):
            a[k, j] = a[j, k]
    return a, b, inverse, zw, zr


def _eliminate(s: Shots, columns: Array, state: Array, residual: Array, rate: bool, outlier: float) -> Reduced:
    """Normal equations of one run; shots whose error is far beyond ``outlier`` (root mean square) count less."""
    p = columns.shape[1]
    used, counts = s.weight, s.counts
    losses = losses_of(s, residual)
    if not (np.all(np.isfinite(columns[used])) and np.all(np.isfinite(state[used])) and np.all(np.isfinite(losses))):
        # The simulation ran away: nothing can be said from here.
        return Reduced(
            np.zeros((p, p)), np.zeros(p), np.full(len(counts), np.inf), counts, lambda dx: (0.0 * s.starts, 0.0),
            columns, state,
        )  # fmt: skip
    wide = np.column_stack([columns, np.ones(len(residual))]) if rate else np.ascontiguousarray(columns)
    trust = 1.0 / (1.0 + losses / np.maximum(counts, 1.0) / outlier**2)
    a, b, inverse, zw, zr = _schur(wide, state, residual, used, np.array(s.edges), trust)
    right, column, pivot = 0.0, np.zeros(p), 1.0
    if rate:
        pivot = max(a[p, p], 1e-300)
        column, right = a[:p, p].copy(), b[p]
        a, b = a[:p, :p] - np.outer(column, column) / pivot, b[:p] - column * right / pivot

    def back(dx: Array) -> tuple[Array, float]:
        bias = float((right - column @ dx) / pivot) if rate else 0.0
        full = np.append(dx, bias) if rate else dx
        return np.einsum("sij,sj->si", inverse, zr - zw @ full), bias

    return Reduced(a, b, losses, counts, back, columns, state)
