"""How the effects of a platform resist on average along the measured motion: as a damping and as a stiffness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.model.effect_torque import torque_along
from identify.signals.trace import Trace
from rig import effects
from rig.arrays import Array
from rig.dynamics import Equations
from rig.effects.base import Place

EVERY = 8  # of the instants of the motion: enough for a mean


def mean_slopes(equations: Equations, traces: Sequence[Trace]) -> tuple[float, float]:
    """Least squares of the effects' torque over rate and angle: N m s/rad and N m/rad; zeros without effects.

    Effects that are linear with their states need no mean, and are left out.
    """
    square, across = np.zeros((2, 2)), np.zeros(2)
    for trace in traces:
        angle, rate = trace.fine[0][::EVERY], trace.fine[1][::EVERY]
        resisted = _resisted(equations, trace)
        x = np.stack([rate, angle - np.mean(angle)])
        square += x @ x.T
        across += x @ (resisted - np.mean(resisted))
    size = np.sqrt(np.maximum(np.diag(square), 1e-300))
    slopes = np.linalg.lstsq(square / np.outer(size, size), across / size, rcond=1e-6)[0] / size
    return (float(slopes[0]), float(slopes[1])) if np.all(np.isfinite(slopes)) else (0.0, 0.0)


def _resisted(equations: Equations, trace: Trace) -> Array:
    """The torque of all effects along one run, at some instants of its motion."""
    angle, rate, time, torque, left = trace.fine
    parameters, _kept = equations.parameters_with(trace)
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    out = np.zeros(len(angle[::EVERY]))
    for k, name in enumerate(equations.body):
        effect = effects.get(name)
        if effect.has_linear_states:
            continue
        every = 1 if effect.states else EVERY  # states follow the motion from instant to instant
        z = effect.rest_state(angle[0], rate[0]) if effect.rest_state else np.zeros(effect.states)
        along, soft = np.empty(len(angle[::every])), max(2.0 * left, 1e-12)
        own = parameters[int(equations.p_at[k]) : int(equations.p_at[k + 1])].copy()
        torque_along(
            effect.kernel.address, angle[::every].copy(), rate[::every].copy(), time[::every].copy(),
            torque[::every].copy(), every * step, np.array(z, dtype=float), 1, own, effect.place is Place.FRICTION,
            soft, along,
        )  # fmt: skip
        out += np.nan_to_num(along if every == EVERY else along[::EVERY], posinf=0.0, neginf=0.0)
    return out
