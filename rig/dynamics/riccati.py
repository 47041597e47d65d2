"""Kalman gains sample by sample: the Riccati recursion, in leaps where the gains change smoothly (compiled).

A gain settles within a few samples where the sensor tells a state at once, and over thousands where it tells it by and
by: the angle beside a gyro, a bias that walks. There the recursion's map over 2^k samples, found by doubling (Anderson
1978; Chu, Fan and Lin, Int. J. Control 77, 2004), leaps to the middle and to the end of a stretch. The gains between
are taken from the parabola through its start, middle and end. How far the middle lies off the parabola through what
came before, the start and the end says how good that is, and how long the next leap may be: both errors grow with the
third power of the step, and the one between is an eighth of the one that is tested.
"""

from __future__ import annotations

import numpy as np

from rig.dynamics.native import jit

LEAP_TOLERANCE = 4e-5  # of a gain and of the innovations' variance, by which a leap's middle may lie off the parabola
# Of what the state's own spread would make of a reading: a gain below that matters less, and may be off by more.
SMALL_GAIN = 0.01
SHORTEST_LEAP, LEVELS = 3, 13  # powers of two: 8 samples at least, 4,096 at most
STEPS_FIRST, STEPS_BETWEEN = 20, 10  # single samples after a start or a lost sample, and after a leap that failed


@jit
def onward(phi, q, p, half):  # type: ignore[no-untyped-def]
    """Covariance a sample later, in place: phi p phi' + q. Loops: a call to a matrix library costs more than this."""
    n = len(q)
    for a in range(n):
        for b in range(n):
            half[a, b] = 0.0
            for c in range(n):
                if phi[a, c] != 0.0:
                    half[a, b] += phi[a, c] * p[c, b]
    for a in range(n):
        for b in range(a + 1):
            total = q[a, b]
            for c in range(n):
                if phi[b, c] != 0.0:
                    total += half[a, c] * phi[b, c]
            p[a, b] = p[b, a] = total


@jit
def _read(reads, noises, measured, p, g, gain, variance):  # type: ignore[no-untyped-def]
    """Gains and variances of one sample's readings, one after the other; the covariance ``p`` after them, in place."""
    n = len(p)
    for k in range(len(reads)):
        s = noises[k]
        for a in range(n):
            g[a] = 0.0
            for b in range(n):
                if reads[k, b] != 0.0:
                    g[a] += p[a, b] * reads[k, b]
        for a in range(n):
            s += reads[k, a] * g[a]
        if not s >= noises[k]:
            s = np.inf  # the linear part ran away: nothing is predicted from here
        variance[k] = s
        if measured:
            for a in range(n):
                gain[k, a] = g[a] / s
            for a in range(n):
                for b in range(n):
                    p[a, b] -= g[a] * g[b] / s


@jit
def _solve(a, b):  # type: ignore[no-untyped-def]
    """a x = b, x in place of b, by Gauss with row exchange; ``a`` is lost."""
    n, width = len(a), b.shape[1]
    for c in range(n):
        top = c
        for r in range(c + 1, n):
            if abs(a[r, c]) > abs(a[top, c]):
                top = r
        if top != c:
            for k in range(n):
                a[c, k], a[top, k] = a[top, k], a[c, k]
            for k in range(width):
                b[c, k], b[top, k] = b[top, k], b[c, k]
        for r in range(c + 1, n):
            f = a[r, c] / a[c, c]
            if f != 0.0:
                for k in range(c + 1, n):
                    a[r, k] -= f * a[c, k]
                for k in range(width):
                    b[r, k] -= f * b[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(width):
            total = b[c, k]
            for r in range(c + 1, n):
                total -= a[c, r] * b[r, k]
            b[c, k] = total / a[c, c]


@jit
def _unit_plus(a, b, out):  # type: ignore[no-untyped-def]
    """1 + a b."""
    n = len(a)
    for i in range(n):
        for j in range(n):
            total = 1.0 if i == j else 0.0
            for k in range(n):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@jit
def _double(maps, level, work, both):  # type: ignore[no-untyped-def]
    """The map over 2^level samples from that over half as many. With W = 1 + G H:

    A+ = A W'^-1 A,  G+ = G + A' W^-1 G A,  H+ = H + A H W^-1 A'.
    """
    a, g, h = maps[level - 1]
    n = len(a)
    _unit_plus(g, h, work[0])
    for i in range(n):
        for j in range(n):
            both[i, j], both[i, n + j] = a[j, i], g[i, j]
    _solve(work[0], both)
    for i in range(n):
        for j in range(n):
            twice = ahead = through = 0.0
            for k in range(n):
                twice += both[k, i] * a[k, j]
                ahead += both[i, n + k] * a[k, j]
                through += h[i, k] * both[k, j]
            maps[level, 0, i, j], work[1, i, j], work[2, i, j] = twice, ahead, through
    for i in range(n):
        for j in range(i + 1):
            seen, driven = g[i, j], h[i, j]
            for k in range(n):
                seen += 0.5 * (a[k, i] * work[1, k, j] + a[k, j] * work[1, k, i])
                driven += 0.5 * (a[i, k] * work[2, k, j] + a[j, k] * work[2, k, i])
            maps[level, 1, i, j] = maps[level, 1, j, i] = seen
            maps[level, 2, i, j] = maps[level, 2, j, i] = driven


@jit
def _leap(over, p, out, work):  # type: ignore[no-untyped-def]
    """Covariance behind a leap: H + A p (1 + G p)^-1 A'."""
    a, g, h = over
    n = len(p)
    _unit_plus(g, p, work[0])
    for i in range(n):
        for j in range(n):
            work[1, i, j] = a[j, i]
    _solve(work[0], work[1])
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += p[i, k] * work[1, k, j]
            work[2, i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = h[i, j]
            for k in range(n):
                total += 0.5 * (a[i, k] * work[2, k, j] + a[j, k] * work[2, k, i])
            out[i, j] = out[j, i] = total


@jit
def _assign(source, target):  # type: ignore[no-untyped-def]
    """A copy by loops: an assignment to a slice compiles for seconds."""
    for a in range(len(source)):
        for b in range(len(source)):
            target[a, b] = source[a, b]


@jit
def _off(before, here, middle, end, back, step, least):  # type: ignore[no-untyped-def]
    """By how many tolerances the middle of a leap lies off the parabola through its ends and what was ``back`` before.

    Infinite where one of them is not a number.
    """
    x = 0.5 * step
    expected = (
        before * x * (x - step) / (back * (back + step))
        - here * (x + back) * (x - step) / (back * step)
        + end * (x + back) * x / ((step + back) * step)
    )
    off, allowed = abs(middle - expected), LEAP_TOLERANCE * (abs(middle) + least)
    if off <= allowed:
        return off / allowed if off > 0.0 else 0.0
    return off / allowed if off < np.inf and allowed > 0.0 else np.inf


@jit
def riccati(phi, q, reads, noises, p, keep, first, last, gain, variance):  # type: ignore[no-untyped-def]
    """Gains (n, m, states) and innovation variances (n, m) of samples first..last, into ``gain`` and ``variance``.

    Parameters
    ----------
    phi, q
        Transition and disturbance covariance over a sample, (states, states).
    reads, noises
        What each reading is of the states, (m, states), and its variance, (m,).
    p
        Covariance before the first reading; the last one afterwards.
    keep
        Samples that were measured, (n,).
    """
    n, m = len(q), len(reads)
    g, work, both = np.zeros(n), np.zeros((3, n, n)), np.zeros((n, 2 * n))
    maps = np.zeros((LEVELS, 3, n, n))
    _assign(phi, maps[0, 0])
    _assign(q, maps[0, 2])
    for k in range(m):
        for a in range(n):
            for b in range(n):
                maps[0, 1, a, b] += reads[k, a] * reads[k, b] / noises[k]
    known, level, back, steps = 0, SHORTEST_LEAP, 1 << SHORTEST_LEAP, STEPS_FIRST
    at_middle, at_end, after = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    gains, spreads = np.zeros((2, m, n)), np.zeros((2, m))
    whole = first  # no sample is lost between here and there
    i = first
    while i <= last:
        whole = max(whole, i)
        while whole <= last and keep[whole]:
            whole += 1
        step = 1 << level
        if steps > 0 or i + step >= whole:
            if steps <= 0 and level > SHORTEST_LEAP:
                level -= 1
                continue
            _read(reads, noises, keep[i], p, g, gain[i], variance[i])
            onward(phi, q, p, work[0])
            steps -= 1
            if not keep[i]:
                steps, level, back = STEPS_FIRST, SHORTEST_LEAP, 1 << SHORTEST_LEAP
            i += 1
            continue
        while known < level:
            known += 1
            _double(maps, known, work, both)
        _leap(maps[level - 1], p, at_middle, work)
        _leap(maps[level], p, at_end, work)
        _assign(at_middle, after)
        _read(reads, noises, True, after, g, gains[0], spreads[0])
        _assign(at_end, after)
        _read(reads, noises, True, after, g, gains[1], spreads[1])
        _assign(p, after)
        _read(reads, noises, True, after, g, gain[i], variance[i])
        off = 0.0
        for k in range(m):
            for a in range(n):
                least = SMALL_GAIN * np.sqrt(at_middle[a, a] / spreads[0, k])
                off = max(
                    off, _off(gain[i - back, k, a], gain[i, k, a], gains[0, k, a], gains[1, k, a], back, step, least)
                )
            off = max(off, _off(variance[i - back, k], variance[i, k], spreads[0, k], spreads[1, k], back, step, 0.0))
        if off <= 1.0:
            for s in range(1, step):
                x = s / step
                begin, middle, end = (1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)
                for k in range(m):
                    variance[i + s, k] = begin * variance[i, k] + middle * spreads[0, k] + end * spreads[1, k]
                    for a in range(n):
                        gain[i + s, k, a] = begin * gain[i, k, a] + middle * gains[0, k, a] + end * gains[1, k, a]
            _assign(at_end, p)
            i += step
            back = step
            if off <= 0.125:  # a leap twice as long lies off eight times as far
                level = min(level + 1, LEVELS - 1)
        elif level > SHORTEST_LEAP:
            while off > 1.0 and level > SHORTEST_LEAP:
                level -= 1
                off /= 8.0
        else:
            steps, back = STEPS_BETWEEN, 1 << SHORTEST_LEAP
