"""The equation of motion, integrated with located stick and slip events (compiled).

One fine step of length h is a classical fourth-order Runge-Kutta step while the motion keeps its
direction. Dry friction makes the right-hand side jump where the rate changes sign; smoothing that jump
moves ten seconds of simulated rate by many sigma however fine the step is, so the instants of
sticking, breaking away and reversing are found by root search and the step is split there. Where the
angle passes a kink of the torque (a gap, a support on one side) it is split as well. A platform under nothing but
constant torques and dry friction of a constant level is linear while it slides: there the step is a matrix.

Layout of the arrays, so that any set of effects runs through one compiled function:
``motion`` holds angle, rate, slip direction (-1, 0 stuck, +1) and time; ``z`` the internal states of all
kernels end to end, ``z_at`` where each kernel's begin; ``p`` the parameter vectors end to end, ``p_at``
where each begins. LOAD kernels come first, FRICTION kernels from ``loads`` on. Behind the last parameter
vector of ``p`` stands for every internal state the angle over which it follows the motion, infinite where it follows
something else, and before these their least. ``jck`` holds inertia, damping, stiffness and one over the inertia.

One step and the loops over many stand in one file: Numba's cache checks the file of the function that is called, so a
change of the step would not reach loops of another file that are compiled already.
"""

from __future__ import annotations

import numpy as np

from rig.dynamics.filters import through_filters
from rig.dynamics.native import call, floats_at, integers_at, jit, offset, pointer

EVENTS_PER_STEP = 12  # more reversals than this in one fine step is chatter: the plant is held stuck
CUTS_PER_KINK = 2  # a cut lands beside its kink by the error of a cubic: it may take a second one
AT_A_KINK = 1e-9  # fraction of a step
MOST_RELAXED = 1.6  # time constants in a Runge-Kutta step after which least is left, 0.27; after 2.79 it runs away


@jit
def _quadratic(m0, m1, m2, x):  # type: ignore[no-untyped-def]
    """Torque at fraction x of the step, through its values at the start, the middle and the end."""
    return m0 * (1.0 - x) * (1.0 - 2.0 * x) + m1 * 4.0 * x * (1.0 - x) + m2 * x * (2.0 * x - 1.0)


@jit
def resisting(first, last, th, w, t, m, z, dz, kernels, z_at, p, p_at):  # type: ignore[no-untyped-def]
    """Sum of the kernels first..last-1; writes their state derivatives."""
    total = 0.0
    for k in range(first, last):
        total += call(kernels[k], th, w, t, m, offset(z, z_at[k]), offset(dz, z_at[k]), offset(p, p_at[k]))
    return total


@jit
def _copy(source, target, n):  # type: ignore[no-untyped-def]
    for i in range(n):
        target[i] = source[i]


@jit
def slowed(dz, n, w, h, count, p, p_at):  # type: ignore[no-untyped-def]
    """Make internal states that follow the motion within an angle follow it no faster than a step can.

    Where the platform turns through several such angles in a step, a state has long reached its limit: how fast it got
    there makes no difference, but the step would overshoot and run away.
    """
    first, turned = p_at[count] + 1, abs(w) * h
    for i in range(n):
        if turned > MOST_RELAXED * p[first + i]:
            dz[i] *= MOST_RELAXED * p[first + i] / turned


@jit
def acceleration(th, w, t, m, slip, z, dz, jck, body):  # type: ignore[no-untyped-def]
    loads, count = body[0], body[1]
    net = m - jck[1] * w - jck[2] * th
    if loads > 0:
        net -= resisting(0, loads, th, w, t, m, z, dz, *body[2:])
    if slip != 0.0 and count > loads:
        net -= slip * resisting(loads, count, th, abs(w), t, m, z, dz, *body[2:])
    return net * jck[3]


@jit
def _rk4(motion, x0, x1, h, m0, m1, m2, n, z, z0, k1, k2, k3, k4, jck, body):  # type: ignore[no-untyped-def]
    """Advance angle, rate and z from fraction x0 to x1 of the step, the slip direction kept."""
    dt = (x1 - x0) * h
    th, w, slip, t = motion[0], motion[1], motion[2], motion[3]
    count, p, p_at = body[1], body[4], body[5]
    most = MOST_RELAXED * p[p_at[count]] / dt if n > 0 else np.inf  # rate beyond which a state would be overrun
    begin = _quadratic(m0, m1, m2, x0)
    middle = _quadratic(m0, m1, m2, 0.5 * (x0 + x1))
    end = _quadratic(m0, m1, m2, x1)
    for i in range(n):
        z0[i] = z[i]
    a1 = acceleration(th, w, t, begin, slip, z, k1, jck, body)
    if abs(w) > most:
        slowed(k1, n, w, dt, count, p, p_at)
    w2, th2 = w + 0.5 * dt * a1, th + 0.5 * dt * w
    for i in range(n):
        z[i] = z0[i] + 0.5 * dt * k1[i]
    a2 = acceleration(th2, w2, t + 0.5 * dt, middle, slip, z, k2, jck, body)
    if abs(w2) > most:
        slowed(k2, n, w2, dt, count, p, p_at)
    w3, th3 = w + 0.5 * dt * a2, th + 0.5 * dt * w2
    for i in range(n):
        z[i] = z0[i] + 0.5 * dt * k2[i]
    a3 = acceleration(th3, w3, t + 0.5 * dt, middle, slip, z, k3, jck, body)
    if abs(w3) > most:
        slowed(k3, n, w3, dt, count, p, p_at)
    w4, th4 = w + dt * a3, th + dt * w3
    for i in range(n):
        z[i] = z0[i] + dt * k3[i]
    a4 = acceleration(th4, w4, t + dt, end, slip, z, k4, jck, body)
    if abs(w4) > most:
        slowed(k4, n, w4, dt, count, p, p_at)
    motion[0] = th + dt * (w + 2.0 * w2 + 2.0 * w3 + w4) / 6.0
    motion[1] = w + dt * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
    motion[3] = t + dt
    for i in range(n):
        z[i] = z0[i] + dt * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0


@jit
def _advance_to(motion, saved, zs, x0, x1, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body):  # type: ignore[no-untyped-def]
    """From the saved motion at fraction x0 to x1: sliding, or stuck while internal states go on."""
    _copy(saved, motion, 4)
    _copy(zs, z, n)
    if motion[2] != 0.0:
        _rk4(motion, x0, x1, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)
        return
    motion[1] = 0.0
    if n == 0:
        motion[3] += (x1 - x0) * h
        return
    # An infinite inertia does not move; the internal states do.
    _rk4(motion, x0, x1, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, (np.inf, jck[1], jck[2], 0.0), body)
    motion[0] = saved[0]
    motion[1] = 0.0


@jit
def _excess(motion, m, z, dz, jck, body):  # type: ignore[no-untyped-def]
    """Net torque on the platform at rate zero, and by how much it exceeds what friction holds."""
    loads, count = body[0], body[1]
    net = m - jck[2] * motion[0] - resisting(0, loads, motion[0], 0.0, motion[3], m, z, dz, *body[2:])
    return net, abs(net) - resisting(loads, count, motion[0], 0.0, motion[3], m, z, dz, *body[2:])


@jit
def step(motion, n, z, work, saved, h, m0, m1, m2, jck, body):  # type: ignore[no-untyped-def]
    """One fine step of length h; m0, m1, m2 are the shaft torque at its start, middle and end."""
    w0, k1, k2, k3, k4, zs = work
    if body[1] == body[0]:
        motion[2] = 0.0
        _rk4(motion, 0.0, 1.0, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)
        return
    x = 0.0
    for _ in range(EVENTS_PER_STEP):
        if x >= 1.0:
            return
        if motion[2] == 0.0:
            net, excess = _excess(motion, _quadratic(m0, m1, m2, x), z, k1, jck, body)
            if excess > 0.0:
                motion[2] = 1.0 if net > 0.0 else -1.0
                continue
        _copy(motion, saved, 4)
        _copy(z, zs, n)
        slip = motion[2]
        _advance_to(motion, saved, zs, x, 1.0, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)
        # What must stay below zero until the step ends: the excess while stuck, the reversal while sliding.
        if slip == 0.0:
            f_hi = _excess(motion, m2, z, k1, jck, body)[1]
            f_lo = _excess(saved, _quadratic(m0, m1, m2, x), zs, k1, jck, body)[1]
        else:
            f_hi = -motion[1] * slip
            f_lo = -saved[1] * slip
        if f_hi <= 0.0:
            return
        lo, hi, side = x, 1.0, 0
        for _k in range(60):  # regula falsi (Illinois)
            if hi - lo < 1e-13 or f_hi < 1e-15:
                break
            mid = (lo * f_hi - hi * f_lo) / (f_hi - f_lo)
            if not lo < mid < hi:
                mid = 0.5 * (lo + hi)
            _advance_to(motion, saved, zs, x, mid, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)
            f = _excess(motion, _quadratic(m0, m1, m2, mid), z, k1, jck, body)[1] if slip == 0.0 else -motion[1] * slip
            if f > 0.0:
                hi, f_hi = mid, f
                if side == 1:
                    f_lo *= 0.5
                side = 1
            else:
                lo, f_lo = mid, f
                if side == -1:
                    f_hi *= 0.5
                side = -1
        hi = max(hi, min(1.0, x + 1e-9))
        _advance_to(motion, saved, zs, x, hi, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)
        motion[1] = 0.0
        net, excess = _excess(motion, _quadratic(m0, m1, m2, hi), z, k1, jck, body)
        if slip == 0.0 or excess > 0.0:
            motion[2] = 1.0 if net > 0.0 else -1.0
        else:
            motion[2] = 0.0
        x = hi
    if x < 1.0:
        motion[2] = 0.0
        _copy(motion, saved, 4)
        _copy(z, zs, n)
        _advance_to(motion, saved, zs, x, 1.0, h, m0, m1, m2, n, z, w0, k1, k2, k3, k4, jck, body)


@jit
def _first_kink(th, w, end, w_end, h, kinks, count):  # type: ignore[no-untyped-def]
    """Fraction of a step at which the angle first passes a kink of the torque; one where it passes none.

    A kink that the step begins at is behind it.
    """
    first = 1.0
    for k in range(count):
        a, b = th - kinks[k], end - kinks[k]
        if a == 0.0 or a * b >= 0.0:
            continue
        x = a / (a - b)
        for _ in range(4):  # Newton on the cubic through both ends
            u = 1.0 - x
            f = a * u * u * (1.0 + 2.0 * x) + b * x * x * (1.0 + 2.0 * u) + h * x * u * (w * u - w_end * x)
            slope = 6.0 * x * u * (b - a) + h * (w * u * (1.0 - 3.0 * x) - w_end * x * (2.0 - 3.0 * x))
            if slope == 0.0:
                break
            x = min(max(x - f / slope, 0.0), 1.0)
        if x > AT_A_KINK:
            first = min(first, x)
    return first


@jit
def step_over_kinks(motion, n, z, work, saved, h, m0, m1, m2, jck, body, kinks, count, before):  # type: ignore[no-untyped-def]
    """``step``, cut where the angle passes a kink of the torque: a Runge-Kutta step must not span one.

    ``before`` has room for the motion and z. A platform that crosses a narrow gap in a step passes both its edges.
    """
    kept = offset(before, 4)
    done = 0.0
    for _ in range(CUTS_PER_KINK * count):
        left = 1.0 - done
        begin = _quadratic(m0, m1, m2, done)
        _copy(motion, before, 4)
        _copy(z, kept, n)
        step(motion, n, z, work, saved, left * h, begin, _quadratic(m0, m1, m2, done + 0.5 * left), m2, jck, body)
        x = _first_kink(before[0], before[1], motion[0], motion[1], left * h, kinks, count)
        if x >= 1.0 - AT_A_KINK:
            return
        _copy(before, motion, 4)
        _copy(kept, z, n)
        part = x * left
        middle, end = _quadratic(m0, m1, m2, done + 0.5 * part), _quadratic(m0, m1, m2, done + part)
        step(motion, n, z, work, saved, part * h, begin, middle, end, jck, body)
        done += part
    left = 1.0 - done
    begin, middle = _quadratic(m0, m1, m2, done), _quadratic(m0, m1, m2, done + 0.5 * left)
    step(motion, n, z, work, saved, left * h, begin, middle, m2, jck, body)


@jit
def step_matrix(h, jck):  # type: ignore[no-untyped-def]
    """A Runge-Kutta step of a platform with nothing on its shaft, (2, 5).

    Angle and rate after it from a unit of angle, of rate, and of the torque at its start, middle and end.
    """
    body = (0, 0, integers_at(0), integers_at(0), floats_at(0), integers_at(0))  # no kernel is called
    none = np.zeros(1)
    z = pointer(none)
    matrix = np.zeros((2, 5))
    for k in range(5):
        unit, push = np.zeros(4), np.zeros(3)
        if k < 2:
            unit[k] = 1.0
        else:
            push[k - 2] = 1.0
        _rk4(pointer(unit), 0.0, 1.0, h, push[0], push[1], push[2], 0, z, z, z, z, z, z, jck, body)
        matrix[0, k], matrix[1, k] = unit[0], unit[1] + 0.0 * none[0]  # keeps the scratch alive
    return matrix


@jit
def matrix_step(matrix, th, w, m0, m1, m2):  # type: ignore[no-untyped-def]
    """Angle and rate after a step of ``step_matrix``."""
    return (
        matrix[0, 0] * th + matrix[0, 1] * w + matrix[0, 2] * m0 + matrix[0, 3] * m1 + matrix[0, 4] * m2,
        matrix[1, 0] * th + matrix[1, 1] * w + matrix[1, 2] * m0 + matrix[1, 3] * m1 + matrix[1, 4] * m2,
    )


@jit
def slide(motion, matrix, load, level, sticks, h, m0, m1, m2):  # type: ignore[no-untyped-def]
    """``step`` under a constant torque ``load`` and a constant level of dry friction.

    False where the platform does not slide to the end of the step; nothing was done then.
    """
    slip, rest = 0.0, load
    if sticks:
        slip = motion[2]
        if slip == 0.0:
            return False
        rest += slip * level
    th, w = matrix_step(matrix, motion[0], motion[1], m0 - rest, m1 - rest, m2 - rest)
    if w * slip < 0.0:
        return False
    motion[0], motion[1], motion[2] = th, w, slip
    motion[3] += h
    return True


@jit
def pull(angle, z, jck, kernels, loads, z_at, p, p_at):  # type: ignore[no-untyped-def]
    """Torque of spring and loads on a platform that stands still at an angle, at time zero."""
    scratch = np.zeros(max(1, len(z)))
    held = np.zeros(max(1, len(z)))
    for i in range(len(z)):
        held[i] = z[i]
    return jck[2] * angle + resisting(
        0, loads, angle, 0.0, 0.0, 0.0, pointer(held), pointer(scratch), pointer(kernels), pointer(z_at),
        pointer(p), pointer(p_at),
    ) + 0.0 * scratch[0] * held[0]  # keeps both alive  # fmt: skip


@jit
def steady_torques(z, dz, body):  # type: ignore[no-untyped-def]
    """Sum of the loads and of the levels of dry friction, of kernels that give one value whatever they are asked."""
    loads, count = body[0], body[1]
    return (
        resisting(0, loads, 0.0, 0.0, 0.0, 0.0, z, dz, *body[2:]),
        resisting(loads, count, 0.0, 0.0, 0.0, 0.0, z, dz, *body[2:]),
    )


@jit
def run_steps(motion, z, h, torque, jck, kernels, loads, z_at, p, p_at, kinks, steady, out):  # type: ignore[no-untyped-def]
    """Integrate ``len(torque)`` fine steps.

    ``torque`` has shape (n, 3): start, middle, end of each step. ``steady``: all kernels give one value whatever they
    are asked. ``out`` has shape (n + 1, 3) and takes angle, rate and acceleration at every fine instant, the start
    included.
    """
    n, states = torque.shape[0], len(z)
    room = np.zeros((10, max(4, states)))
    work = (
        pointer(room[0]), pointer(room[1]), pointer(room[2]),
        pointer(room[3]), pointer(room[4]), pointer(room[5]),
    )  # fmt: skip
    saved, dz, before, bends = pointer(room[6]), pointer(room[7]), pointer(room[8:]), pointer(kinks)
    mo, zp = pointer(motion), pointer(z)
    jck = (jck[0], jck[1], jck[2], 1.0 / jck[0])
    body = (loads, len(kernels), pointer(kernels), pointer(z_at), pointer(p), pointer(p_at))
    t0 = motion[3]
    sticks, matrix = len(kernels) > loads, step_matrix(h, jck)
    load, level = steady_torques(zp, dz, body) if steady else (0.0, 0.0)
    for i in range(n + 1):
        m = torque[i, 0] if i < n else torque[n - 1, 2]
        if mo[2] == 0.0 and sticks:
            a = 0.0
        elif steady:
            a = (m - load - (mo[2] * level if sticks else 0.0) - jck[1] * mo[1] - jck[2] * mo[0]) * jck[3]
        else:
            a = acceleration(mo[0], mo[1], mo[3], m, mo[2], zp, dz, jck, body)
        out[i, 0], out[i, 1], out[i, 2] = mo[0], mo[1], a
        if i < n:
            m0, m1, m2 = torque[i, 0], torque[i, 1], torque[i, 2]
            if not steady or not slide(mo, matrix, load, level, sticks, h, m0, m1, m2):
                step_over_kinks(
                    mo, states, zp, work, saved, h, m0, m1, m2, jck, body, bends, len(kinks), before
                )  # fmt: skip
            mo[3] = t0 + (i + 1) * h
            if not abs(mo[0]) < 1e9:  # diverged (or not a number): nothing after it means anything
                out[i + 1 :, :] = np.nan
                return room[0, 0]
    return room[0, 0]  # keeps the scratch alive until the last step


@jit
def run_spans(  # type: ignore[no-untyped-def]
    starts, spans, offset_s, z, h, torque, jck, kernels, loads, z_at, p, p_at, kinks, steady, out
):
    """``run_steps`` over spans (first, last) of fine steps, each begun from its row of ``starts``.

    Internal states go on from span to span.
    """
    motion = np.empty(4)
    for k in range(len(spans)):
        first, last = spans[k, 0], spans[k, 1]
        motion[0], motion[1] = starts[k, 0], starts[k, 1]
        motion[2], motion[3] = np.sign(starts[k, 1]), offset_s + first * h
        run_steps(
            motion, z, h, torque[first:last], jck, kernels, loads, z_at, p, p_at, kinks, steady, out[first : last + 1]
        )  # fmt: skip


@jit
def laid_out(table):  # type: ignore[no-untyped-def]
    """What stands behind the addresses of ``Equations.table``, as ``step_over_kinks`` takes it."""
    scratch, width = floats_at(table[3]), max(4, table[1])
    body = (
        table[4], table[5], integers_at(table[6]), integers_at(table[7]), floats_at(table[8]), integers_at(table[9]),
    )  # fmt: skip
    constants = floats_at(table[10])
    jck = (constants[0], constants[1], constants[2], 1.0 / constants[0])
    work = (
        scratch, offset(scratch, width), offset(scratch, 2 * width),
        offset(scratch, 3 * width), offset(scratch, 4 * width), offset(scratch, 5 * width),
    )  # fmt: skip
    saved, before = offset(scratch, 6 * width), offset(scratch, 7 * width)
    return (
        floats_at(table[0]),
        table[1],
        floats_at(table[2]),
        jck,
        body,
        work,
        saved,
        before,
        table[12],
        floats_at(table[13]),
    )


@jit
def advance(table, values):  # type: ignore[no-untyped-def]
    """A few fine steps under a torque running linearly from one value to another, drive and sensor included.

    Everything that stays the same comes as addresses in ``table`` (see ``Stepper``): a call takes one
    microsecond instead of fifty. ``values`` holds the fine step and the torque at start and end; it takes
    angle, rate, sensed rate and shaft torque, and must hold the shaft torque of the previous call.
    """
    motion, states, z, jck, body, work, saved, before, kinks, bends = laid_out(table)
    h, m_start, m_end, steps = values[0], values[1], values[2], table[11]
    for i in range(steps):
        shaft = through_filters(m_start + (m_end - m_start) * (i + 1) / steps, h, table, 14)
        begin = values[6]
        if m_start == m_end and table[14] == 0:
            begin = m_start  # held: the torque jumps at the start of the step
        step_over_kinks(
            motion, states, z, work, saved, h, begin, 0.5 * (begin + shaft), shaft, jck, body, bends, kinks, before
        )
        values[3], values[4], values[6] = motion[0], motion[1], shaft
        values[5] = through_filters(motion[1], h, table, 20)
