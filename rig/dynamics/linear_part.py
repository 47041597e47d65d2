"""The linear part of a platform: what a Kalman filter takes it for.

An effect whose torque and states are linear in the motion (a flexible mode, creep) is part of it, with its states: a
torque that nobody recorded sets the payload on a soft mount swinging as it does the shaft, and what the readings tell
of the one they tell of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig import effects
from rig.arrays import Array
from rig.dynamics.equations import Equations
from rig.dynamics.native import call, jit, pointer

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class LinearPart:
    """Inertia, damping and stiffness as the motion meets them, and the states that follow it linearly.

    Attributes
    ----------
    states
        Which of the platform's internal states these are, s of them.
    by_motion, by_states
        Their rates of change by angle and rate, (s, 2), and by themselves, (s, s).
    torque
        Resisting torque by each of them, (s,); what angle and rate add to it is in the stiffness and damping.
    at_rest
        What they are by angle and rate where a run begins, (s, 2).
    begin_at_rest
        Whether each begins so in motion, too, (s,): those of a curve, which would follow anything that settles.
    """

    inertia: float
    damping: float
    stiffness: float
    states: tuple[int, ...] = ()
    by_motion: Rows = ()
    by_states: Rows = ()
    torque: tuple[float, ...] = ()
    at_rest: Rows = ()
    begin_at_rest: tuple[bool, ...] = ()


@jit
def _resisting(kernel, angle, rate, z, dz, p):  # type: ignore[no-untyped-def]
    return call(kernel, angle, rate, 0.0, 0.0, pointer(z), pointer(dz), pointer(p))


def linear_part(equations: Equations, jck: Sequence[float]) -> LinearPart:
    """The linear part: ``jck`` (with the mean slopes of what is not linear), and all linear effects with states."""
    inertia, damping, stiffness = (float(x) for x in jck)
    places, motion, own, pull, rest, known = [], [], [], [], [], []
    for k, name in enumerate(equations.body):
        effect, at = effects.get(name), int(equations.z_at[k])
        if not effect.has_linear_states:
            continue
        n, kernel = effect.states, int(equations.kernels[k])
        p = equations.p[int(equations.p_at[k]) : int(equations.p_at[k + 1])].copy()
        columns = np.empty((1 + n, 2 + n))  # torque and rates of the states by angle, rate and each state
        for c, unit in enumerate(np.eye(2 + n)):
            rates = np.zeros(n)
            columns[0, c] = _resisting(kernel, unit[0], unit[1], unit[2:].copy(), rates, p)
            columns[1:, c] = rates
        stiffness, damping = stiffness + float(columns[0, 0]), damping + float(columns[0, 1])
        places += list(range(at, at + n))
        known += [name in effects.free_forms()] * n
        motion.append(columns[1:, :2])
        own.append(columns[1:, 2:])
        pull += columns[0, 2:].tolist()
        stands = effect.rest_state
        rest.append(np.array([stands(1.0, 0.0), stands(0.0, 1.0)]).T if stands else np.zeros((n, 2)))
    if not places:
        return LinearPart(inertia, damping, stiffness)
    together = np.zeros((len(places), len(places)))
    begin = 0
    for block in own:
        end = begin + len(block)
        together[begin:end, begin:end], begin = block, end
    return LinearPart(
        inertia, damping, stiffness, tuple(places), _rows(np.vstack(motion)), _rows(together), tuple(pull),
        _rows(np.vstack(rest)), tuple(known),
    )  # fmt: skip


def _rows(matrix: Array) -> Rows:
    return tuple(tuple(row) for row in matrix.tolist())
