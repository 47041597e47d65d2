"""One-step prediction of the motion: simulated, and corrected at every sample (Kalman filter, compiled).

A torque that nobody recorded (current ripple, the floor, a cable) sets a simulated platform off for good. A Kalman
filter in innovations form takes it up: the nonlinear simulator predicts each sample from the one before, the
difference to the measurement corrects angle, rate, the states of linear effects (a flexible mode rings with the shaft)
and an estimate of the coloured part of that torque. The gains come
from the linear part of the platform and its noises (``rig.dynamics.gains``). With no torque disturbance they are zero
and the prediction is the simulation of the whole run (Ljung, System Identification, ch. 7; Astrom, Automatica 16,
1980).

A gyro and an encoder are two readings of one state, taken one after the other at every sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.dynamics.equations import Equations, Readings
from rig.dynamics.exact_lags import CHORDS, lag_table
from rig.dynamics.gains import BIAS, STATES, Gains
from rig.dynamics.grid import Smoothing
from rig.dynamics.integrator import (
    acceleration,
    matrix_step,
    resisting,
    slide,
    steady_torques,
    step_matrix,
    step_over_kinks,
)
from rig.dynamics.low_pass import corner_table
from rig.dynamics.native import call_filter, jit, offset, pointer


@jit
def _between(w0, a0, w1, a1, h, x, same):  # type: ignore[no-untyped-def]
    """Rate at fraction x of a step, from rate and acceleration at both ends; ``same``: it never stuck or turned."""
    u = 1.0 - x
    if same:
        return u * u * (1.0 + 2.0 * x) * w0 + x * x * (1.0 + 2.0 * u) * w1 + h * x * u * (u * a0 - x * a1)
    w = w0 + a0 * x * h  # straight to a standstill, and straight on from where it left it
    if w * w0 > 0.0:
        return w
    w = w1 - a1 * u * h
    return w if w * w1 > 0.0 else 0.0


@jit
def _behind(lag, at, h, w0, a0, w1, a1, y, v):  # type: ignore[no-untyped-def]
    """Output of a low-pass and its slope after a step, along the cubic through rate and acceleration at both ends.

    ``at`` is where the row of ``lag_table`` holds what such a step leaves of both.
    """
    a, b = lag[0], lag[1]
    c2, c3 = (3.0 * (w1 - w0) / h - 2.0 * a0 - a1) / h, (2.0 * (w0 - w1) / h + a0 + a1) / (h * h)
    q2 = c2 - 3.0 * a * c3  # of the cubic that the output runs along once it has settled
    q1 = a0 - 2.0 * a * q2 - 6.0 * b * c3
    q0 = w0 - a * q1 - 2.0 * b * q2
    y, v = y - q0, v - q1
    out = q0 + h * (q1 + h * (q2 + h * c3)) + lag[at] * y + lag[at + 1] * v
    if b > 0.0:
        return out, q1 + h * (2.0 * q2 + 3.0 * h * c3) + lag[at + 2] * y + lag[at + 3] * v
    return out, (w1 - out) / a if a > 0.0 else a1


@jit
def _rounded(motion, smooth, torque, rise, corner, table, reach_s, jck, z, spare, body):  # type: ignore[no-untyped-def]
    """What a gyro's low-pass adds to the rate where dry friction is about to turn the platform, or has just done so.

    There the acceleration jumps by twice the friction, or to none where the platform stops. ``corner`` holds when and
    by how much: foreseen while the platform comes to a standstill, remembered afterwards. ``smooth`` and ``torque`` are
    angle, rate and torque as the filter makes them of a linear platform's: ripple moves no corner that is foreseen.
    ``rise`` is how fast that torque changes, in N m/s.
    """
    slip, now = motion[2], motion[3]
    if slip != 0.0:
        w = motion[1] + smooth[1]
        a = acceleration(motion[0] + smooth[0], w, now, torque, slip, z, spare, jck, body)
        slows, speed = -slip * a, slip * w
        square = slows * slows - 2.0 * slip * (rise - jck[1] * a - jck[2] * w) / jck[0] * speed
        if slows > 0.0 and speed < 2.0 * reach_s * slows:
            # Where the parabola through rate, acceleration and jerk stays above zero, the platform turns by itself.
            ahead_s = 2.0 * speed / (slows + np.sqrt(square)) if square > 0.0 else np.inf
            friction = resisting(body[0], body[1], motion[0], 0.0, now, torque, z, spare, *body[2:])
            corner[0], corner[1] = now + ahead_s, slip * min(2.0 * friction / jck[0], np.sqrt(max(square, 0.0)))
    at = abs(now - corner[0]) / reach_s * (len(table) - 1)
    if not at < len(table) - 1:
        return 0.0
    k = int(at)
    return corner[1] * (table[k] + (at - k) * (table[k + 1] - table[k]))


@jit
def _predict(  # type: ignore[no-untyped-def]
    starts, spans, offset_s, z, rests, h, ratio, torque, jck, kernels, loads, z_at, p, p_at, kinks,
    filters, fs, fs_at, fp, fp_at, lags, behind, measured, keep, gain, tracked, coloured, decay, walks, walk_decay,
    rate, bias, reads, smoothing, settled, corners, reach_s, steady, out, state,
):  # fmt: skip
    n_states, readings = len(z), measured.shape[1]
    room = np.zeros((10, max(4, n_states)))
    work = (
        pointer(room[0]), pointer(room[1]), pointer(room[2]),
        pointer(room[3]), pointer(room[4]), pointer(room[5]),
    )  # fmt: skip
    saved, spare, before, bends = pointer(room[6]), pointer(room[7]), pointer(room[8:]), pointer(kinks)
    motion, corner, smooth = np.empty(4), np.empty(2), np.empty(2)
    smooths = len(smoothing) > 0
    mo, zp = pointer(motion), pointer(z)
    jck4 = (jck[0], jck[1], jck[2], 1.0 / jck[0])
    body = (loads, len(kernels), pointer(kernels), pointer(z_at), pointer(p), pointer(p_at))
    frictions, filtered = len(kernels) > loads, len(filters) > 0 or len(lags) > 0
    matrix = step_matrix(h, jck4)
    load, level = steady_torques(zp, spare, body) if steady else (0.0, 0.0)
    for k in range(len(spans)):
        first, last = spans[k, 0], spans[k, 1]
        if k > 0:  # a stretch that was not measured was simulated; what is inside goes on from there beside the motion
            for s in range(len(tracked)):
                at = tracked[s]
                z[at] += rests[0, at] * (starts[k, 0] - motion[0]) + rests[1, at] * (starts[k, 1] - motion[1])
        motion[0], motion[1], motion[2] = starts[k, 0], starts[k, 1], np.sign(starts[k, 1])
        motion[3] = offset_s + first * ratio * h
        slow, aim, held, slope, walked = 0.0, 0.0, 0.0, 0.0, 0.0
        corner[0], corner[1] = -np.inf, 0.0
        smooth[:] = 0.0
        if smooths:
            smooth[0], smooth[1] = settled[first * ratio, 0] / jck[0], settled[first * ratio, 1] / jck[0]
        before_nm = 0.0
        # A correction of the rate is a jump. The filters see the rate without its jumps, and the sum of these passes
        # the linear low-pass with what the low-pass holds back.
        jumps = 0.0
        fs[:] = 0.0
        behind[:] = 0.0
        still = motion[1]
        sensed = motion[1]
        for i in range(first, last + 1):
            rounded = 0.0
            if frictions and smooths:
                s, at = (i * ratio, 0) if i < last else (i * ratio - 1, 2)
                now = torque[s, at] + smoothing[s, at] + slow
                rise = (now - before_nm) / (ratio * h) if i > first else 0.0
                before_nm = now
                rounded = _rounded(motion, smooth, now, rise, corner, corners, reach_s, jck4, zp, spare, body)
            for m in range(readings):
                y = sensed + held + bias + rounded if rate and m == 0 else motion[0]
                y += walks[m] * walked
                out[i, m] = y
                if keep[i]:
                    e = measured[i, m] - y
                    motion[0] += gain[i, m, 0] * e
                    motion[1] += gain[i, m, 1] * e
                    jumps += gain[i, m, 1] * e
                    slow += gain[i, m, 2] * e
                    aim += gain[i, m, 3] * e
                    held += gain[i, m, 4] * e
                    slope += gain[i, m, 5] * e
                    walked += gain[i, m, BIAS] * e
                    for s in range(len(tracked)):
                        z[tracked[s]] += gain[i, m, STATES + s] * e
                    if frictions and gain[i, m, 1] != 0.0:
                        motion[2] = np.sign(motion[1])
            state[i, 0], state[i, 1], state[i, 2], state[i, 3], state[i, 4] = motion[0], motion[1], slow, aim, walked
            if i == last:
                break
            onward = coloured[0, 0] * slow + coloured[0, 1] * aim
            acting = 0.5 * (slow + onward)  # held over the sample: its mean there
            for s in range(i * ratio, (i + 1) * ratio):
                w0, slip, a0 = motion[1] + smooth[1], motion[2], 0.0
                if filtered and (slip != 0.0 or not frictions):
                    a0 = acceleration(
                        mo[0], mo[1], mo[3], torque[s, 0] + acting, slip, zp, spare, jck4, body
                    )  # fmt: skip
                if smooths:
                    m0, m1, m2 = smoothing[s, 0], smoothing[s, 1], smoothing[s, 2]
                    a0 += (m0 - jck[1] * smooth[1] - jck[2] * smooth[0]) / jck[0]
                    smooth[0], smooth[1] = matrix_step(matrix, smooth[0], smooth[1], m0, m1, m2)
                n0, n1, n2 = torque[s, 0] + acting, torque[s, 1] + acting, torque[s, 2] + acting
                if not steady or not slide(mo, matrix, load, level, frictions, h, n0, n1, n2):
                    step_over_kinks(
                        mo, n_states, zp, work, saved, h, n0, n1, n2, jck4, body, bends, len(kinks), before
                    )  # fmt: skip
                motion[3] = offset_s + (s + 1) * h
                w1 = motion[1] + smooth[1]
                if not filtered:
                    sensed = w1 - jumps
                    continue
                a1 = 0.0
                if motion[2] != 0.0 or not frictions:
                    a1 = acceleration(mo[0], mo[1], mo[3], torque[s, 2] + acting, mo[2], zp, spare, jck4, body)
                if smooths:
                    a1 += (smoothing[s, 2] - jck[1] * smooth[1] - jck[2] * smooth[0]) / jck[0]
                same = slip == motion[2]
                parts = reads if len(lags) == 0 else 1 if same else CHORDS
                before_part = w0 - jumps - still
                for r in range(1, parts + 1):
                    sensed = w1 if r == parts else _between(w0, a0, w1, a1, h, r / parts, same)
                    sensed -= jumps + still
                    began, begins, ends = before_part, a0, a1
                    if not same:
                        begins = ends = (sensed - began) * parts / h
                    before_part = sensed
                    for f in range(len(lags)):
                        y, v = behind[f, 0], behind[f, 1]
                        sensed, ends = _behind(
                            lags[f], 2 if same else 6, h / parts, began, begins, sensed, ends, y, v
                        )  # fmt: skip
                        began, begins, behind[f, 0], behind[f, 1] = y, v, sensed, ends
                    for f in range(len(filters)):
                        sensed = call_filter(
                            filters[f], sensed, h / reads, offset(pointer(fs), fs_at[f]), offset(pointer(fp), fp_at[f])
                        )  # fmt: skip
                sensed += still
            slow, aim = onward, coloured[1, 1] * aim
            walked *= walk_decay
            held -= jumps
            held, slope = decay[0, 0] * held + decay[0, 1] * slope, decay[1, 0] * held + decay[1, 1] * slope
            held += jumps
            if not abs(motion[0]) < 1e9:
                out[i + 1 : last + 1] = np.nan
                break
    return room[0, 0]


def predict_ahead(
    equations: Equations, torque: Array, step_s: float, ratio: int, spans: Sequence[tuple[int, int]], starts: Array,
    measured: Array, keep: Any, gains: Gains, rate: bool, bias: float, offset_s: float = 0.0,
    readings: Readings | None = None, reads: int = 1, low_pass: tuple[float, float] | None = None,
    smoothing: Smoothing | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Every reading predicted from those before it, (n, m), and the states after it, (n, 5).

    Those are angle, rate, coloured torque and what it is heading for, and the slow error of the reading (a gyro's bias
    beyond ``bias``).

    Parameters
    ----------
    torque
        Shaft torque at start, middle and end of each fine step, (m, 3).
    step_s, ratio
        The fine step, and how many make a sample.
    spans
        First and last sample of every stretch; each begins from its row of ``starts`` (angle, rate).
    measured, keep
        The readings, (n, m), with a gyro's before an encoder's, and which samples were measured, (n,).
    reads
        How often in a fine step the sensor's filters are fed, where they are not all low-passes that are followed as
        such.
    low_pass
        Corner in Hz and delay in s of the gyro's own symmetric low-pass, None where it has none.
    smoothing
        What that low-pass adds to the torque. A linear platform answers to it as the filter changes its rate, in steps
        of the torque above all; what is left for the filter to round are the corners that dry friction makes.
    """
    p, _kept = equations.parameters_with(readings)
    filters, fs, fs_at, fp, fp_at = equations.sensor.arrays(step_s)
    low_passes = equations.low_passes
    lags = lag_table(low_passes or (), step_s)
    filters = filters if low_passes is None else filters[:0]
    corners, reach_s = (np.zeros(2), 1.0) if low_pass is None else (corner_table(*low_pass), low_pass[1])
    smoothing = Smoothing(np.zeros((0, 3)), np.zeros((0, 2))) if smoothing is None else smoothing
    out, state = np.zeros(measured.shape), np.zeros((len(measured), 5))
    rests = np.zeros((2, equations.states))
    if len(spans) > 1 and len(gains.of_effects):
        rests = np.array([equations.rest_states(*unit) for unit in ((1.0, 0.0), (0.0, 1.0))])
    _predict(
        np.ascontiguousarray(starts), np.array(spans, dtype=np.int64).reshape(-1, 2), offset_s,
        equations.rest_states(*starts[0]), rests, step_s, ratio, torque, equations.jck, equations.kernels,
        equations.loads, equations.z_at, p, equations.p_at, equations.kinks, filters, fs, fs_at, fp, fp_at,
        lags, np.zeros((len(lags), 2)),
        measured, keep, gains.gain, gains.of_effects, gains.coloured, gains.held,
        np.ascontiguousarray(gains.reads[:, BIAS]), gains.walk_decay, rate, bias, reads,
        smoothing.torque_nm, smoothing.begins, corners, reach_s, equations.steady,
        out, state,
    )  # fmt: skip
    return out, state
