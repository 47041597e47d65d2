"""Eighth-order Runge-Kutta between located events (compiled).

Coefficients of Dormand and Prince's DOP853 (Hairer, Norsett, Wanner, Solving ODEs I, II.5) as scipy carries
them. In one step every switch keeps its sign; where one would change it, the first such instant is found by
root search, the step ends there, and the next begins with the other sign. Dry friction is one switch more:
while sliding the rate may not change its direction, while stuck the net torque may not exceed the level.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from scipy.integrate._ivp import dop853_coefficients as dop

from benchmarks.blind.physics import rhs

jit = nb.njit(cache=True, error_model="numpy")
STAGES = dop.N_STAGES
A = np.ascontiguousarray(dop.A[:STAGES, :STAGES])
B = np.ascontiguousarray(dop.B[:STAGES])
C = np.ascontiguousarray(dop.C[:STAGES])
EVENTS = 400  # in one step; more is chatter, and the step is finished as it is


@jit
def _step(t, y, h, out, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts):  # type: ignore[no-untyped-def]
    """``out`` takes the state a time h later."""
    n = len(y)
    for k in range(STAGES):
        for i in range(n):
            x = 0.0
            for j in range(k):
                x += A[k, j] * stages[j, i]
            work[i] = y[i] + h * x
        rhs(t + C[k] * h, work, stages[k], jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
    for i in range(n):
        x = 0.0
        for k in range(STAGES):
            x += B[k] * stages[k, i]
        out[i] = y[i] + h * x


@jit
def _room(t, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs):  # type: ignore[no-untyped-def]
    """How far the nearest switch is from changing its sign (negative: it has). Fills ``g`` and ``dy``.

    A switch that stands at zero has no side: those of the rate all the while that friction holds, that of the
    torque all the while that a dead zone keeps it from the shaft. They have a say when they leave it.
    """
    net, level, _ = rhs(t, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
    room = np.inf
    for i in range(len(s)):
        if g[i] != 0.0:
            room = min(room, s[i] * g[i])
    if rubs:
        room = min(room, slip * y[1] if slip != 0.0 else level - abs(net))
    return room


@jit
def _dips(h, w0, a0, w1, a1, slip):  # type: ignore[no-untyped-def]
    """Fraction of the step where the rate (a cubic through both ends) is lowest, if it is below zero there; else 1."""
    best, at = 0.0, 1.0
    for k in range(1, 8):
        x = k / 8.0
        u = 1.0 - x
        w = w0 * u * u * (1.0 + 2.0 * x) + w1 * x * x * (1.0 + 2.0 * u) + h * (a0 * x * u * u - a1 * x * x * u)
        if slip * w < best:
            best, at = slip * w, x
    return at


@jit
def advance(
    t, y, h, slip, end, mid, dy, stages, work, jck, codes, zo, po, so, p, s, g, late, kind, a, tones, parts, rubs
):  # type: ignore[no-untyped-def]
    """From t to t + h, in place, through every event. Returns the slip direction at the end."""
    x = 0.0
    for _ in range(EVENTS):
        left = h - x
        if left <= 1e-14:
            return slip
        now = _room(t + x, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs)
        w0, a0 = y[1], dy[1]
        if now < 0.0:  # an event stands here: a switch to turn, a contact to let go or to hold
            for i in range(len(s)):
                if s[i] * g[i] < 0.0:
                    s[i] = -s[i]
            if rubs:
                slip = _contact(t + x, y, dy, slip, jck, codes, zo, po, so, p, s, g, late, kind, a, tones, parts)
            now = _room(t + x, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs)
            w0, a0 = y[1], dy[1]
        _step(t + x, y, left, end, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
        after = _room(t + h, end, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs)
        hi = left
        if after >= 0.0:
            at = _dips(left, w0, a0, end[1], dy[1], slip) if rubs and slip != 0.0 else 1.0
            if at < 1.0:
                _step(t + x, y, at * left, end, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a,
                      tones, parts)  # fmt: skip
                after = _room(t + x + at * left, end, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones,
                              parts, rubs)  # fmt: skip
                hi = at * left
            if after >= 0.0:
                for i in range(len(y)):
                    y[i] = end[i]
                x += hi
                continue
        lo, low = 0.0, now
        for k in range(3):  # a switch that stands at zero now has to leave it first
            if low > 0.0:
                break
            lo = hi * 10.0 ** (-2 - 3 * k)
            _step(t + x, y, lo, mid, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
            low = _room(t + x + lo, mid, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs)
        if low <= 0.0:
            hi, lo = lo, 0.0
        else:
            high, side = after, 0
            for _k in range(80):  # Illinois
                if hi - lo < 1e-14:
                    break
                x1 = (lo * high - hi * low) / (high - low)
                if not lo < x1 < hi:
                    x1 = 0.5 * (lo + hi)
                _step(
                    t + x, y, x1, mid, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts
                )
                f = _room(t + x + x1, mid, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts, rubs)
                if f < 0.0:
                    hi, high = x1, f
                    low = 0.5 * low if side == 1 else low
                    side = 1
                else:
                    lo, low = x1, f
                    high = 0.5 * high if side == -1 else high
                    side = -1
                if f == 0.0:
                    break
        hi = max(hi, 1e-13)
        _step(t + x, y, hi, end, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
        for i in range(len(y)):
            y[i] = end[i]
        x += hi
    _step(t + x, y, h - x, end, stages, work, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
    for i in range(len(y)):
        y[i] = end[i]
    return slip


@jit
def _contact(t, y, dy, slip, jck, codes, zo, po, so, p, s, g, late, kind, a, tones, parts):  # type: ignore[no-untyped-def]
    """The slip direction after an event of dry friction; a platform that has come to rest gets the rate 0."""
    if slip != 0.0:
        if slip * y[1] >= 0.0:
            return slip
        y[1] = 0.0
    net, level, _ = rhs(t, y, dy, jck, codes, zo, po, so, p, s, g, late, 0.0, kind, a, tones, parts)
    if abs(net) <= level:
        return 0.0
    return 1.0 if net > 0.0 else -1.0


@jit
def run(y, steps, step_s, substeps, slip, jck, codes, zo, po, so, p, s, late, kind, a, tones, rubs, motion, parts_out):  # type: ignore[no-untyped-def]
    """Integrate a set. ``motion`` (n, 4) takes angle, rate, shaft torque and first sensor state at every sample.

    ``parts_out`` (n, effects) takes the resisting torque that each effect adds. Returns False where it diverged.
    """
    n = len(y)
    stages = np.zeros((STAGES, n))
    work, end, mid, dy = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    g, parts = np.zeros(len(s)), np.zeros(max(1, len(codes)))
    sensor = -1
    for k in range(len(codes)):
        if codes[k] == 300:
            sensor = zo[k]
    h = step_s / substeps
    if rubs and y[1] != 0.0:
        slip = 1.0 if y[1] > 0.0 else -1.0
    rhs(0.0, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
    for k in range(len(s)):
        s[k] = -1.0 if g[k] < 0.0 else 1.0
    for i in range(steps + 1):
        t = i * step_s
        net, level, m = rhs(t, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts)
        motion[i, 0], motion[i, 1], motion[i, 2] = y[0], y[1], m
        motion[i, 3] = y[sensor] if sensor >= 0 else y[1]
        for k in range(len(codes)):
            if 100 <= codes[k] < 200:
                parts[k] = net * parts[k] / max(level, 1e-300) if slip == 0.0 else slip * parts[k]
            parts_out[i, k] = parts[k]
        if i == steps:
            break
        for k in range(substeps):
            begin, length = t + k * h, h
            if begin < late < begin + h:  # the torque begins with a kink
                slip = advance(begin, y, late - begin, slip, end, mid, dy, stages, work, jck, codes, zo, po, so, p, s,
                               g, late, kind, a, tones, parts, rubs)  # fmt: skip
                begin, length = late, begin + h - late
            slip = advance(begin, y, length, slip, end, mid, dy, stages, work, jck, codes, zo, po, so, p, s, g, late,
                           kind, a, tones, parts, rubs)  # fmt: skip
        if not abs(y[0]) < 1e3:
            return False
    return True
