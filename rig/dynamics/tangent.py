"""Linearised motion: the first-order change by a small torque or another initial state.

Around a motion that runs smoothly the equation of motion is linear with coefficients that follow the motion. One pass
over it reads them off; from then on every small change costs a product of small matrices a step, not a simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig.arrays import Array
from rig.dynamics.integrator import jit, pointer, resisting, slowed

if TYPE_CHECKING:
    from rig.dynamics.equations import Equations, Readings

DIFFERENCE_SHARE = 1e-6  # of the largest angle, rate and state: what the coefficients are read off over


@jit
def _state_along(motion, middle, spans, t0, z, h, torque, kernels, loads, z_at, p, p_at, out):  # type: ignore[no-untyped-def]
    """Internal states in the middle of every fine step of a given motion, (m, states), by Runge-Kutta steps."""
    n = len(z)
    k = np.zeros((4, n))
    now = np.zeros(n)
    body = (pointer(kernels), pointer(z_at), pointer(p), pointer(p_at))
    for s in range(len(spans)):
        for i in range(spans[s, 0], spans[s, 1]):
            t = t0 + i * h
            for stage in range(4):
                at = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                for j in range(n):
                    now[j] = z[j] + (at * h * k[stage - 1, j] if stage > 0 else 0.0)
                if stage == 0:
                    th, w, m = motion[i, 0], motion[i, 1], torque[i, 0]
                elif stage == 3:
                    th, w, m = motion[i + 1, 0], motion[i + 1, 1], torque[i, 2]
                else:
                    th, w, m = middle[i, 0], middle[i, 1], torque[i, 1]
                resisting(0, loads, th, w, t + at * h, m, pointer(now), pointer(k[stage]), *body)
                slowed(k[stage], n, w, h, len(kernels), p, p_at)
            for j in range(n):
                out[i, j] = z[j] + h * (5.0 * k[0, j] + 4.0 * (k[1, j] + k[2, j]) - k[3, j]) / 24.0
                z[j] += h * (k[0, j] + 2.0 * k[1, j] + 2.0 * k[2, j] + k[3, j]) / 6.0


@jit
def _step_of(f, h, push, powers, out):  # type: ignore[no-untyped-def]
    """A fourth-order Runge-Kutta step of dx/dt = f x + push m as the matrix that it is, (n, n + 3)."""
    n = len(f)
    for r in range(n):
        for c in range(n):
            powers[0, r, c] = h * f[r, c]
    for k in range(1, 4):
        for c in range(n):
            powers[k, 0, c] = h * powers[k - 1, 1, c]  # the angle changes with the rate alone
        for r in range(1, n):
            for c in range(n):
                total = 0.0
                for j in range(n):
                    total += powers[0, r, j] * powers[k - 1, j, c]
                powers[k, r, c] = total
    share = h * push / 6.0
    for r in range(n):
        for c in range(n):
            out[r, c] = powers[0, r, c] + powers[1, r, c] / 2.0 + powers[2, r, c] / 6.0 + powers[3, r, c] / 24.0
        out[r, r] += 1.0
        out[r, n] = share * (powers[0, r, 1] + powers[1, r, 1] / 2.0 + powers[2, r, 1] / 4.0)
        out[r, n + 1] = share * (2.0 * powers[0, r, 1] + powers[1, r, 1] / 2.0)
        out[r, n + 2] = 0.0
    out[1, n] += share
    out[1, n + 1] += 4.0 * share
    out[1, n + 2] = share


@jit
def _coefficients(middle, states, spans, t0, h, torque, jck, kernels, loads, z_at, p, p_at, near, out):  # type: ignore[no-untyped-def]
    """For every fine step what its end owes to its start and to the torque at its three instants, (m, n, n + 3)."""
    n = len(near)
    f = np.zeros((n, n))
    z, dz, dz0 = np.zeros(max(1, n - 2)), np.zeros(max(1, n - 2)), np.zeros(max(1, n - 2))
    powers = np.zeros((4, n, n))
    body = (pointer(kernels), pointer(z_at), pointer(p), pointer(p_at))
    f[0, 1] = 1.0
    for s in range(len(spans)):
        for i in range(spans[s, 0], spans[s, 1]):
            th, w, t, m = middle[i, 0], middle[i, 1], t0 + (i + 0.5) * h, torque[i, 1]
            for j in range(n - 2):
                z[j] = states[i, j]
            pull = resisting(0, loads, th, w, t, m, pointer(z), pointer(dz0), *body)
            slowed(dz0, n - 2, w, h, len(kernels), p, p_at)
            for c in range(n):
                if c >= 2:
                    z[c - 2] += near[c]
                a, b = th + (near[0] if c == 0 else 0.0), w + (near[1] if c == 1 else 0.0)
                slope = (resisting(0, loads, a, b, t, m, pointer(z), pointer(dz), *body) - pull) / near[c]
                slowed(dz, n - 2, b, h, len(kernels), p, p_at)
                if c >= 2:
                    z[c - 2] = states[i, c - 2]
                slope += jck[2] if c == 0 else (jck[1] if c == 1 else 0.0)
                f[1, c] = -slope / jck[0]
                for j in range(n - 2):
                    f[2 + j, c] = (dz[j] - dz0[j]) / near[c]
            _step_of(f, h, 1.0 / jck[0], powers, out[i])


@jit
def _respond(table, spans, push, angle, rate, z, out):  # type: ignore[no-untyped-def]
    """What a push, (m, 3), and other starts add to angle and rate at every fine instant."""
    n = table.shape[1]
    x, new = np.zeros(n), np.zeros(n)
    for j in range(len(z)):  # an assignment to a slice compiles for seconds
        x[2 + j] = z[j]
    pushed = len(push) > 0
    for s in range(len(spans)):
        x[0], x[1] = angle, rate
        first, last = spans[s, 0], spans[s, 1]
        for i in range(first, last):
            out[i, 0], out[i, 1] = x[0], x[1]
            for r in range(n):
                total = 0.0
                for c in range(n):
                    total += table[i, r, c] * x[c]
                if pushed:
                    total += table[i, r, n] * push[i, 0] + table[i, r, n + 1] * push[i, 1]
                    total += table[i, r, n + 2] * push[i, 2]
                new[r] = total
            for r in range(n):
                x[r] = new[r]
        out[last, 0], out[last, 1] = x[0], x[1]


def smooth(equations: Equations) -> bool:
    """Whether a motion has such a neighbourhood: nothing holds the platform, and its torque does not bend."""
    return not equations.sticks and len(equations.kinks) == 0


class Tangent:
    """The neighbourhood of a motion that ``Equations.integrate_shots`` has found.

    Parameters
    ----------
    motion
        Angle, rate and acceleration at every fine instant, (m + 1, 3).
    torque, step_s, spans, starts, offset_s, readings
        As they were given there.

    Attributes
    ----------
    middle
        Angle, rate and acceleration in the middle of every fine step, (m, 3).
    begin, end
        Acceleration at the start and at the end of every fine step, (m,): a held torque jumps in between.
    """

    def __init__(
        self, equations: Equations, motion: Array, torque: Array, step_s: float, spans: Sequence[tuple[int, int]],
        starts: Array, offset_s: float = 0.0, readings: Readings | None = None,
    ) -> None:  # fmt: skip
        e, h = equations, step_s
        self.equations, self.spans = e, np.array(spans, dtype=np.int64).reshape(-1, 2)
        self._starts, self._n = starts, 2 + e.states
        angle, rate = motion[:, 0], motion[:, 1]
        j = float(e.jck[0])
        pull = np.append(torque[:, 0], torque[-1, 2]) - j * motion[:, 2]  # of everything but the inertia
        half = 0.5 * (pull[1:] + pull[:-1])
        half[1:-1] += (pull[1:-2] + pull[2:-1] - pull[:-3] - pull[3:]) / 16.0
        self.begin, self.end = motion[:-1, 2], (torque[:, 2] - pull[1:]) / j
        self.middle = np.stack(
            [
                0.5 * (angle[1:] + angle[:-1]) + h / 8.0 * (rate[:-1] - rate[1:]),
                0.5 * (rate[1:] + rate[:-1]) + h / 8.0 * (self.begin - self.end),
                (torque[:, 1] - half) / j,
            ],
            axis=1,
        )
        self.motion, self.torque = motion, torque
        p, _kept = e.parameters_with(readings)
        states = np.zeros((len(torque), e.states))
        body = (e.kernels, e.loads, e.z_at, p, e.p_at)
        if e.states:
            _state_along(
                motion, self.middle, self.spans, offset_s, e.rest_states(*starts[0]), h, torque, *body, states
            )  # fmt: skip
        sizes = [np.max(np.abs(x), initial=0.0) for x in (angle, rate, *states.T)]
        self._near = DIFFERENCE_SHARE * np.array([s if 0.0 < s < np.inf else 1.0 for s in sizes])
        self._table = np.zeros((len(torque), self._n, self._n + 3))
        _coefficients(
            self.middle, states, self.spans, offset_s, h, torque, tuple(e.jck.tolist()), *body, self._near, self._table
        )  # fmt: skip

    def moved(self, torque: Array | None = None, start: tuple[float, float] = (0.0, 0.0)) -> Array:
        """What a torque, (m, 3), and an angle and rate at every start add to angle and rate, (m + 1, 2)."""
        out = np.zeros((len(self.torque) + 1, 2))
        z = np.zeros(self._n - 2)
        if any(start) and len(z):
            at, e = self._starts[0], self.equations
            step = self._near[:2]
            here = e.rest_states(*at)
            for k in range(2):
                beside = at.copy()
                beside[k] += step[k]
                z += start[k] * (e.rest_states(*beside) - here) / step[k]
        push = np.zeros((0, 3)) if torque is None else np.ascontiguousarray(torque)
        _respond(self._table, self.spans, push, *start, z, out)
        return out
