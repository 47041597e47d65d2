"""Rig, drive and control loop in fine steps (compiled): fourth-order Runge-Kutta, dry friction that sticks.

In a fine step the torque is held. Where the rate changes its sign within a step of a rig that rubs, the step is
divided there: the shaft sticks while the torque on it stays below the friction level, else it slides on.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.field.plant import drive, friction, jit, load

OPEN, POSITION_LOOP, CASCADE = range(3)


@jit
def _derivative(y, dy, t, torque, slip, jck, codes, zo, po, p):  # type: ignore[no-untyped-def]
    """Fills dy; returns net torque without dry friction and the friction level, N m."""
    th, w = y[0], y[1]
    net = torque - jck[1] * w - jck[2] * th
    level = 0.0
    for k in range(len(codes)):
        if codes[k] < 100:
            net -= load(codes[k], th, w, t, jck[2], y, dy, zo[k], p, po[k])
        elif codes[k] < 200:
            level += friction(codes[k], th, abs(w), t, torque, p, po[k])
    if slip == 0.0:
        dy[0] = 0.0
        dy[1] = 0.0
    else:
        dy[0] = w
        dy[1] = (net - slip * level) / jck[0]
    return net, level


@jit
def _step(y, out, work, d1, d2, d3, d4, h, t, torque, slip, jck, codes, zo, po, p):  # type: ignore[no-untyped-def]
    """One step of Runge-Kutta from y into out."""
    n = len(y)
    _derivative(y, d1, t, torque, slip, jck, codes, zo, po, p)
    for i in range(n):
        work[i] = y[i] + 0.5 * h * d1[i]
    _derivative(work, d2, t + 0.5 * h, torque, slip, jck, codes, zo, po, p)
    for i in range(n):
        work[i] = y[i] + 0.5 * h * d2[i]
    _derivative(work, d3, t + 0.5 * h, torque, slip, jck, codes, zo, po, p)
    for i in range(n):
        work[i] = y[i] + h * d3[i]
    _derivative(work, d4, t + h, torque, slip, jck, codes, zo, po, p)
    for i in range(n):
        out[i] = y[i] + h / 6.0 * (d1[i] + 2.0 * d2[i] + 2.0 * d3[i] + d4[i])


@jit
def _let_go(y, d1, t, torque, jck, codes, zo, po, p):  # type: ignore[no-untyped-def]
    """Direction in which a shaft at rest begins to slide, 0 where friction holds it."""
    net, level = _derivative(y, d1, t, torque, 0.0, jck, codes, zo, po, p)
    return 0.0 if abs(net) <= level else math.copysign(1.0, net)


@jit
def simulate(h, before, jck, codes, zo, po, p, delay, loop, reference, acts, disturbance, start, states, rubs):  # type: ignore[no-untyped-def]
    """Motion of one run. ``before`` fine steps pass before t = 0.

    ``loop`` is kind, kp, kd or kv, ki, filter time, encoder step, current loop time; ``reference`` (n, 2) angle and
    rate, or torque in the first column where the loop is open; ``acts`` says in which steps the controller acts.
    Returns (n + 1, 5): angle, rate, command, current (both before the drive effects), torque on the shaft (mean
    over the step), and the mean torque of the drive before its effects (n). NaN where the rig ran away.
    """
    n = len(disturbance)
    out = np.zeros((n + 1, 5))
    asked = np.zeros(n)
    y = np.zeros(states)
    end, work = np.zeros(states), np.zeros(states)
    d1, d2, d3, d4 = np.zeros(states), np.zeros(states), np.zeros(states), np.zeros(states)
    y[0] = start
    for k in range(len(codes)):
        if codes[k] in (7, 12, 18):
            y[zo[k]] = start
    slip = 0.0 if rubs else 1.0
    command = current = integral = smooth_rate = 0.0
    seen = start
    since, late = 0, delay / h
    whole = int(late)
    part = late - whole
    for i in range(n):
        t = (i - before) * h
        if acts[i]:
            step = since * h if since > 0 else h
            since = 0
            if loop[0] == 0.0:
                command = reference[i, 0]
            else:
                angle = loop[5] * round(y[0] / loop[5]) if loop[5] > 0.0 else y[0]
                a = math.exp(-step / loop[4])
                smooth_rate = a * smooth_rate + (1.0 - a) * (angle - seen) / step
                seen = angle
                if loop[0] == 1.0:
                    command = loop[1] * (reference[i, 0] - angle) + loop[2] * (reference[i, 1] - smooth_rate)
                else:
                    slow = loop[1] * (reference[i, 0] - angle) + reference[i, 1] - smooth_rate
                    integral += loop[3] * slow * step
                    command = loop[2] * slow + integral
        since += 1
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = y[0], y[1], command, current
        if loop[6] > 0.0:
            a = math.exp(-h / loop[6])
            x = command + (current - command) * (1.0 - a) * loop[6] / h
            current = command + (current - command) * a
        else:
            x = current = command
        asked[i] = x
        if late > 0.0:
            x = (1.0 - part) * asked[max(i - whole, 0)] + part * asked[max(i - whole - 1, 0)]
        for k in range(len(codes)):
            if codes[k] > 200 and codes[k] != 207:
                x = drive(codes[k], x, y[1], h, y, zo[k], p, po[k])
        out[i, 4] = x
        x += disturbance[i]
        left = h
        for _ in range(4 if rubs else 1):
            if rubs and slip == 0.0:
                slip = _let_go(y, d1, t + h - left, x, jck, codes, zo, po, p)
            _step(y, end, work, d1, d2, d3, d4, left, t + h - left, x, slip, jck, codes, zo, po, p)
            if not rubs or slip == 0.0 or slip * end[1] >= 0.0:
                for s in range(states):
                    y[s] = end[s]
                left = 0.0
                break
            share = y[1] / (y[1] - end[1])
            if share > 1e-6:
                _step(y, end, work, d1, d2, d3, d4, share * left, t + h - left, x, slip, jck, codes, zo, po, p)
                for s in range(states):
                    y[s] = end[s]
            left *= 1.0 - share
            y[1] = 0.0
            slip = 0.0
        if not abs(y[0]) < 1e6:
            out[:, 0] = np.nan
            return out, asked
    out[n, 0], out[n, 1], out[n, 2], out[n, 3] = y[0], y[1], command, current
    return out, asked


@jit
def along(code, h, before, angle, rate, torque, stiffness, p, states):  # type: ignore[no-untyped-def]
    """Torque in N m that an effect takes along a given motion, one mean a fine step, shape (n,).

    ``angle`` and ``rate`` (n + 1), ``torque`` (n): that of the drive before the effect. Where the shaft
    stands still dry friction takes none.
    """
    n = len(torque)
    out = np.zeros(n)
    y, d1, d2, mid = np.zeros(states + 1), np.zeros(states + 1), np.zeros(states + 1), np.zeros(states + 1)
    if code in (7, 12, 18):
        y[0] = angle[0]
    late = p[0] / h if code == 200 else 0.0
    whole = int(late)
    part = late - whole
    for i in range(n):
        t = (i - before + 0.5) * h
        th, w = 0.5 * (angle[i] + angle[i + 1]), 0.5 * (rate[i] + rate[i + 1])
        if code == 200:
            out[i] = torque[i] - (1.0 - part) * torque[max(i - whole, 0)] - part * torque[max(i - whole - 1, 0)]
        elif code > 200:
            out[i] = torque[i] - drive(code, torque[i], w, h, y, 0, p, 0)
        elif code >= 100:
            if abs(w) > 0.0:
                out[i] = math.copysign(friction(code, th, abs(w), t, torque[i], p, 0), w)
        else:
            load(code, angle[i], rate[i], t - 0.5 * h, stiffness, y, d1, 0, p, 0)
            for s in range(states):
                mid[s] = y[s] + 0.5 * h * d1[s]
            out[i] = load(code, th, w, t, stiffness, mid, d2, 0, p, 0)
            for s in range(states):
                y[s] += h * d2[s]
    return out
