"""An effect's torque along a motion that is given, not simulated (compiled)."""

from __future__ import annotations

from functools import lru_cache

import numba as nb
import numpy as np

from rig import effects
from rig.dynamics.native import call, pointer
from rig.effects.base import Place


@nb.njit(cache=True, error_model="numpy", nogil=True)
def torque_along(kernel, angle, rate, time, torque, step, z, substeps, p, friction, soft, out):  # type: ignore[no-untyped-def]
    """An effect's torque along a given motion; its states by the midpoint rule, one state linearly implicit."""
    n = len(angle)
    states = len(z)
    dz, mid = np.zeros(max(1, states)), np.zeros(max(1, states))
    zz = np.zeros(max(1, states))
    for j in range(states):  # an assignment to a slice compiles for seconds
        zz[j] = z[j]
    pz, pd, pm, pp = pointer(zz), pointer(dz), pointer(mid), pointer(p)
    h = step / substeps
    for i in range(n):
        w = rate[i]
        if friction:
            s = w / soft if abs(w) < soft else np.sign(w)
            out[i] = s * call(kernel, angle[i], abs(w), time[i], torque[i], pz, pd, pp)
        else:
            out[i] = call(kernel, angle[i], w, time[i], torque[i], pz, pd, pp)
        if states > 0 and i < n - 1:
            for k in range(substeps):
                u, v = k / substeps, (k + 0.5) / substeps
                a0 = angle[i] + u * (angle[i + 1] - angle[i])
                w0 = rate[i] + u * (rate[i + 1] - rate[i])
                a1 = angle[i] + v * (angle[i + 1] - angle[i])
                w1 = rate[i] + v * (rate[i + 1] - rate[i])
                t = time[i] + u * step
                if states == 1:  # linearly implicit: bristles and relaxations may be far faster than a step
                    z0 = zz[0]
                    delta = 1e-6 * (1.0 + abs(z0))
                    zz[0] = z0 + delta
                    call(kernel, a1, w1, t, torque[i], pz, pd, pp)
                    f1 = dz[0]
                    zz[0] = z0
                    call(kernel, a1, w1, t, torque[i], pz, pd, pp)
                    f0 = dz[0]
                    zz[0] = z0 + h * f0 / (1.0 - 0.5 * h * min((f1 - f0) / delta, 0.0))
                    continue
                call(kernel, a0, w0, t, torque[i], pz, pd, pp)
                for j in range(states):
                    mid[j] = zz[j] + 0.5 * h * dz[j]
                call(kernel, a1, w1, t, torque[i], pm, pd, pp)
                for j in range(states):
                    zz[j] += h * dz[j]


@lru_cache(maxsize=256)
def feeds_on_torque(name: str) -> bool:
    """Whether an effect on the shaft changes with the torque itself, as friction under load does."""
    effect = effects.get(name)
    if effect.place in (Place.DRIVE, Place.SENSOR) or effect.states or effect.reads is not None:
        return False
    p = np.array([1.0, 1.0, 1.0, *(1.0 if q.linear else max(q.low, 0.1) for q in effect.parameters)])
    one, out = np.full(2, 0.1), np.zeros(2)
    torque_along(effect.kernel.address, one, one, one, np.array([1.0, 3.0]), 1.0, np.zeros(0), 1, p, False, 1.0, out)
    return bool(out[0] != out[1])
