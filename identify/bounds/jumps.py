"""Whether the torque of an effect jumps where a parameter says: then no small change of that parameter shows.

The error of a fit is a staircase over such a parameter (the angle at which a torque switches on): flat between two
samples, with a step at each. A standard error comes from slopes, and there are none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.model.effect_torque import torque_along
from identify.model.parameters import Name
from identify.signals.trace import Trace
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place

SLOPE_STEP = 1e-7  # of the value: only a slope shows it
JUMP_STEP = 0.3  # of the value: it moves a jump past samples
TORQUE_VALUES_A_RUN = 400  # places of the measured motion at which the torque is looked at
JUMP = "jumps"


def why_of_a_jump(fitted: FinalFit, name: Name, traces: Sequence[Trace]) -> str:
    """Why the data give no interval of a parameter whose effect jumps there, with the cure; empty for any other.

    Parameters
    ----------
    name
        (effect, parameter); of other parameters nothing is said.
    traces
        Runs whose motion is looked at.
    """
    if len(name) != 2 or effects.get(name[0]).place not in (Place.LOAD, Place.FRICTION):
        return ""
    value = fitted.values[name]
    if value == 0.0 or not _jumps(fitted, name, traces):
        return ""
    return (
        f"the torque of the effect {JUMP} at it, so the error does not change with a small change of it and there is "
        "no interval. In the kernel replace the jump by a steep slope, e.g. `x > a` by 0.5 * (1 + tanh((x - a) / "
        "width))"
    )


def _jumps(fitted: FinalFit, name: Name, traces: Sequence[Trace]) -> bool:
    """Whether a small change leaves every torque as it was, bit for bit, and a larger one does not."""
    effect = effects.get(name[0])
    if effect.kernel is None or effect.states:
        return False
    values = {p.name: fitted.values.get((name[0], p.name), p.low) for p in effect.parameters}
    terms = [fitted.values.get((t,), 0.0) for t in ("inertia", "damping", "stiffness")]

    def torque_nm(of_parameter: float) -> Array:
        own = {**values, name[1]: of_parameter}
        return _torque_nm(name[0], [*terms, *own.values()], traces)

    at = values[name[1]]
    now = torque_nm(at)
    return np.array_equal(now, torque_nm(at * (1.0 + SLOPE_STEP))) and any(
        not np.array_equal(now, torque_nm(at * (1.0 + sign * JUMP_STEP))) for sign in (-1.0, 1.0)
    )


def _torque_nm(effect: str, p: Sequence[float], traces: Sequence[Trace]) -> Array:
    """Torque of the effect along the measured motion, N m, about ``TORQUE_VALUES_A_RUN`` values a run."""
    out = []
    for trace in traces:
        every = max(1, len(trace.fine[0]) // TORQUE_VALUES_A_RUN)
        angle, rate, time, torque = (np.ascontiguousarray(x[::every]) for x in trace.fine[:4])
        along = np.zeros(len(angle))
        torque_along(
            effects.get(effect).kernel.address, angle, rate, time, torque, 1.0, np.zeros(0), 1, np.array(p),
            False, 1.0, along,
        )  # fmt: skip
        out.append(along)
    return np.concatenate(out)
