"""The linear part of a platform over one sample: its transition and what white noise adds meanwhile (compiled).

A fit asks for it at every step and for every derivative, of matrices so small that a call to a matrix library costs
more than the arithmetic.
"""

from __future__ import annotations

import numpy as np

from rig.dynamics.native import jit

SHORT = 0.25  # of the largest row or column sum of f, in such a part of a sample: there the series end soon
SERIES_TERMS = 14  # of both series: 0.25^14 / 14! and 0.5^14 / 14! are below the rounding of a double
BALANCING_ROUNDS = 20  # at most; a matrix of this size needs three to five


@jit
def _balance(f, scale):  # type: ignore[no-untyped-def]
    """Scale states by powers of two until rows and columns of ``f`` are alike, in place (Osborne, J. ACM 7, 1960)."""
    n = len(f)
    for i in range(n):
        scale[i] = 1.0
    for _ in range(BALANCING_ROUNDS):
        done = True
        for i in range(n):
            row = column = 0.0
            for j in range(n):
                if j != i:
                    row += abs(f[i, j])
                    column += abs(f[j, i])
            if row <= 0.0 or column <= 0.0:
                continue
            by = 2.0 ** np.round(0.5 * np.log2(row / column))
            if by == 1.0:
                continue
            done = False
            scale[i] *= by
            for j in range(n):
                f[i, j] /= by
                f[j, i] *= by
        if done:
            return


@jit
def _product(a, b, out):  # type: ignore[no-untyped-def]
    n = len(a)
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            if a[i, k] != 0.0:
                for j in range(n):
                    out[i, j] += a[i, k] * b[k, j]


@jit
def _twice(phi, q, half, work):  # type: ignore[no-untyped-def]
    """From a part of a sample to one twice as long, in place: q + phi q phi' and phi phi."""
    n = len(phi)
    _product(phi, q, half)
    for i in range(n):
        for j in range(i + 1):
            total = q[i, j]
            for k in range(n):
                total += half[i, k] * phi[j, k]
            work[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            q[i, j] = q[j, i] = work[i, j]
    _product(phi, phi, half)
    for i in range(n):
        for j in range(n):
            phi[i, j] = half[i, j]


@jit
def over_a_sample(f, density, step_s, phi, q):  # type: ignore[no-untyped-def]
    """Transition exp(f h) and the integral of exp(f s) density exp(f' s) over s = 0..h, into ``phi`` and ``q``.

    Power series over a part of the sample that is short for the fastest state, then doubled: nothing cancels, however
    fast a state is (in the block exponential of van Loan, 1978, what decays stands beside what grows).

    Parameters
    ----------
    f, density
        Of dx/dt = f x + white noise of that two-sided density, (n, n); both are scaled in place.
    step_s
        The sample h.
    phi, q
        (n, n), written.
    """
    n = len(f)
    scale, term, other, work = np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    _balance(f, scale)
    largest = 0.0
    for i in range(n):
        row = column = 0.0
        for j in range(n):
            row += abs(f[i, j])
            column += abs(f[j, i])
            density[i, j] /= scale[i] * scale[j]
        largest = max(largest, row, column)
    doublings = 0
    part_s = step_s
    while largest * part_s > SHORT:
        part_s *= 0.5
        doublings += 1
    for i in range(n):
        for j in range(n):
            phi[i, j] = term[i, j] = 1.0 if i == j else 0.0
            q[i, j] = work[i, j] = density[i, j] * part_s
    for k in range(1, SERIES_TERMS + 1):
        _product(f, term, other)
        for i in range(n):
            for j in range(n):
                term[i, j] = other[i, j] * part_s / k
                phi[i, j] += term[i, j]
        _product(f, work, other)
        for i in range(n):
            for j in range(n):
                work[i, j] = (other[i, j] + other[j, i]) * part_s / (k + 1)
                q[i, j] += work[i, j]
    for _ in range(doublings):
        _twice(phi, q, other, work)
    for i in range(n):
        for j in range(n):
            phi[i, j] *= scale[i] / scale[j]
            q[i, j] *= scale[i] * scale[j]
