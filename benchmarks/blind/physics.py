"""The hidden platform's equations, written from the pages in docs/effects and from nothing else (compiled).

J a + C w + K th + loads + slip * friction = m, and m is what the drive makes of the torque asked for.

Every kink (the sign of a rate, the edge of a gap, a limit) is a switch: a smooth function whose zero the
integrator locates. Between two zeros the sign of each switch stands still in ``s`` and the right-hand side
is smooth, so that a high order keeps its promise.
"""

from __future__ import annotations

import math

import numba as nb

from benchmarks.blind.excitations import torque_at

jit = nb.njit(cache=True, error_model="numpy")

LOADS = (
    "quadratic_damping", "directional_damping", "cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness",
    "backlash", "hysteresis", "creep", "stiffness_drift", "unbalance", "cogging", "torque_offset", "flexible_mode",
    "periodic_disturbance", "presliding_friction", "bump_stop", "hard_stops", "shaken_stiffness", "two_relaxations",
)  # fmt: skip
FRICTIONS = ("coulomb_friction", "stribeck_friction", "load_dependent_friction", "friction_by_angle")
DRIVES = (
    "torque_delay", "actuator_lag", "torque_saturation", "torque_deadzone", "torque_ripple", "warming_gain",
    "coupling_slip", "sagging_gain", "coarse_torque",
)  # fmt: skip
SENSORS = ("sensor_lag", "rate_bias", "aliased_vibration", "cubic_gyro")
CODES = {
    name: group * 100 + i for group, g in enumerate((LOADS, FRICTIONS, DRIVES, SENSORS)) for i, name in enumerate(g)
}
CODES["standing_tone"] = CODES["periodic_disturbance"]  # the same torque: only its start differs
STATES = {
    "hysteresis": 1, "creep": 1, "flexible_mode": 2, "presliding_friction": 1, "two_relaxations": 2,
    "actuator_lag": 1, "warming_gain": 1, "coupling_slip": 2, "sensor_lag": 1,
}  # fmt: skip
SWITCHES = {
    "quadratic_damping": 1, "directional_damping": 1, "bilinear_stiffness": 1, "backlash": 2, "hysteresis": 2,
    "presliding_friction": 1, "bump_stop": 1, "hard_stops": 2, "load_dependent_friction": 1,
    "torque_saturation": 2, "torque_deadzone": 2, "coupling_slip": 1, "sagging_gain": 1,
}  # fmt: skip


@jit
def _hysteresis(w, y, z, dy, p, q, s, i, g):  # type: ignore[no-untyped-def]
    """p: level, yield angle, exponent, share."""
    g[i], g[i + 1] = w, y[z]
    size = (s[i + 1] * y[z]) ** p[q + 2] if s[i + 1] * y[z] > 0.0 else 0.0
    dy[z] = w / p[q + 1] * (1.0 - size * (p[q + 3] * s[i] * s[i + 1] + 1.0 - p[q + 3]))
    return p[q] * y[z]


@jit
def _flexible_mode(th, w, y, z, dy, p, q):  # type: ignore[no-untyped-def]
    """p: inertia, frequency in Hz, damping ratio."""
    own = 2.0 * math.pi * p[q + 1]
    pull = own * own * (th - y[z]) + 2.0 * p[q + 2] * own * (w - y[z + 1])
    dy[z] = y[z + 1]
    dy[z + 1] = pull
    return p[q] * pull


@jit
def _backlash(th, k, p, q, s, i, g):  # type: ignore[no-untyped-def]
    """p: half of the gap."""
    g[i], g[i + 1] = th - p[q], th + p[q]
    if s[i] > 0.0:
        return -k * p[q]
    return -k * th if s[i + 1] > 0.0 else k * p[q]


@jit
def load(code, th, w, t, jck, y, z, dy, p, q, s, i, g):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Resisting torque of a load; its states begin at y[z], its parameters at p[q], its switches at g[i]."""
    if code == 0:
        g[i] = w
        return p[q] * w * w * s[i]
    if code == 1:
        g[i] = w
        return p[q] * w if s[i] > 0.0 else 0.0
    if code == 2:
        return p[q] * th * th * th
    if code == 3:
        return p[q] * th * th
    if code == 4:
        g[i] = th
        return p[q] * th if s[i] > 0.0 else 0.0
    if code == 5:
        return _backlash(th, jck[2], p, q, s, i, g)
    if code == 6:
        return _hysteresis(w, y, z, dy, p, q, s, i, g)
    if code == 7:
        dy[z] = (th - y[z]) / p[q + 1]
        return p[q] * (th - y[z])
    if code == 8:
        return p[q] * t * th
    if code == 9:
        return p[q] * math.sin(th) + p[q + 1] * math.cos(th)
    if code == 10:
        return p[q] * math.sin(p[q + 2] * th) + p[q + 1] * math.cos(p[q + 2] * th)
    if code == 11:
        return p[q]
    if code == 12:
        return _flexible_mode(th, w, y, z, dy, p, q)
    if code == 13:
        return p[q] * math.sin(2.0 * math.pi * p[q + 1] * t + p[q + 2])
    if code == 14:
        g[i] = w
        dy[z] = (w - s[i] * w * y[z]) / p[q + 1]
        return p[q] * y[z]
    return _outside(code, th, w, t, y, z, dy, p, q, s, i, g)


@jit
def _outside(code, th, w, t, y, z, dy, p, q, s, i, g):  # type: ignore[no-untyped-def]
    """Loads that no library has."""
    if code == 15:  # a bump stop on one side: stiffness and damper beyond an angle
        g[i] = th - p[q + 1]
        return p[q] * (th - p[q + 1] + p[q + 2] * w) if s[i] > 0.0 else 0.0
    if code == 16:  # stops on both sides, at angles that differ
        g[i], g[i + 1] = th - p[q + 1], th + p[q + 2]
        if s[i] > 0.0:
            return p[q] * (th - p[q + 1])
        return p[q] * (th + p[q + 2]) if s[i + 1] < 0.0 else 0.0
    if code == 17:  # a stiffness that something outside modulates
        return p[q] * th * math.sin(2.0 * math.pi * p[q + 1] * t + p[q + 2])
    dy[z] = (th - y[z]) / p[q + 1]  # a spring of two relaxations, and friction-like squares of them
    dy[z + 1] = (th * abs(th) - y[z + 1]) / p[q + 2]
    return p[q] * (th - y[z] + 6.0 * (th * abs(th) - y[z + 1]))


@jit
def friction(code, th, speed, t, m, p, q, s, i, g):  # type: ignore[no-untyped-def]
    """Level of dry friction, never negative."""
    if code == 100:
        return p[q]
    if code == 101:
        x = speed / p[q + 2]
        return p[q] + (p[q + 1] - p[q]) * math.exp(-x * x)
    if code == 102:
        g[i] = m
        return p[q] * m * s[i]
    return p[q] * (1.0 + p[q + 1] * math.sin(p[q + 2] * th + p[q + 3]))  # a bearing with a tight spot


@jit
def drive(code, x, w, t, y, z, dy, p, q, s, i, g):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Torque behind one element of the drive; a delay is an earlier clock and passes here."""
    if code == 201:
        dy[z] = (x - y[z]) / p[q]
        return y[z]
    if code == 202:
        g[i], g[i + 1] = x - p[q], x + p[q]
        return p[q] if s[i] > 0.0 else (x if s[i + 1] > 0.0 else -p[q])
    if code == 203:
        g[i], g[i + 1] = x - p[q], x + p[q]
        return x - p[q] if s[i] > 0.0 else (0.0 if s[i + 1] > 0.0 else x + p[q])
    if code == 204:  # ripple locked to the command
        return x + p[q] * math.sin(2.0 * math.pi * x / p[q + 1] + p[q + 2])
    if code == 205:  # the gain falls as the motor warms: heat is the square of the torque, smoothed
        dy[z] = (x * x / (p[q + 2] * p[q + 2]) - y[z]) / p[q + 1]
        return x * (1.0 - p[q] * y[z])
    if code == 206:  # the motor's inertia behind a coupling that slips: p inertia, stiffness, slip torque, damping
        g[i] = y[z] - w
        twist = p[q + 1] * y[z + 1]
        passed = twist + p[q + 3] * (y[z] - w)
        dy[z] = (x - passed) / p[q]
        dy[z + 1] = (y[z] - w) * (1.0 - s[i] * twist / p[q + 2])
        return passed
    if code == 207:  # less torque at speed
        g[i] = w
        return x * (1.0 - p[q] * w * s[i])
    if code == 208:  # a smoothed staircase of the command
        return x - p[q] * math.sin(2.0 * math.pi * x / p[q + 1]) - 0.3 * p[q] * math.sin(6.0 * math.pi * x / p[q + 1])
    return x


@jit
def rhs(t, y, dy, jck, codes, zo, po, so, p, s, g, late, slip, kind, a, tones, parts):  # type: ignore[no-untyped-def]
    """Right-hand side with the switches held. Returns net torque without dry friction, its level, shaft torque.

    ``slip`` is the direction of sliding, 0 where stuck; ``parts`` takes what each effect adds to the resisting side.
    """
    th, w = y[0], y[1]
    m = torque_at(t - late, kind, a, tones)
    if late > 0.0:
        for k in range(len(codes)):
            if codes[k] == 200:
                parts[k] = torque_at(t, kind, a, tones) - m
    for k in range(len(codes)):
        if 200 < codes[k] < 300:
            x = drive(codes[k], m, w, t, y, zo[k], dy, p, po[k], s, so[k], g)
            parts[k] = m - x
            m = x
    net = m - jck[1] * w - jck[2] * th
    for k in range(len(codes)):
        if codes[k] < 100:
            parts[k] = load(codes[k], th, w, t, jck, y, zo[k], dy, p, po[k], s, so[k], g)
            net -= parts[k]
    level = 0.0
    for k in range(len(codes)):
        if 100 <= codes[k] < 200:
            parts[k] = friction(codes[k], th, abs(w), t, m, p, po[k], s, so[k], g)
            level += parts[k]
        elif codes[k] == 300:
            dy[zo[k]] = (w - y[zo[k]]) / p[po[k]]
    if slip == 0.0:
        dy[0] = 0.0
        dy[1] = 0.0
    else:
        dy[0] = w
        dy[1] = (net - slip * level) / jck[0]
    return net, level, m
