"""Where dry friction holds a platform when a run begins: anywhere within a band about the spring's rest.

A gyro does not say where, and the angle is fitted as a start state. But when the platform breaks loose depends on it,
and with that the phase in which it rings: the fit has false minima, and which one is right shows in a look at all.
"""

from __future__ import annotations

import numpy as np

from identify.model.effect_torque import torque_along
from identify.simulate.shots import RUNAWAY, Shots, begins_at_rest, make_shots, predict
from rig import effects
from rig.dynamics import Equations
from rig.effects.base import Place
from rig.recording.run import Array

STUCK_START_GRID_POINTS = 21  # at starts within the band, which holds a few false minima
CLOSER = (-0.75, -0.5, -0.25, 0.25, 0.5, 0.75)  # of the way to the next look
SPAN_S, SPAN_PERIODS = 0.5, 8.0  # of a run that are looked at, whichever is longer: the ring after it broke loose
BETTER_START_RATIO = 0.5  # of the squares that another start has to leave at most
SLOW_TO_BREAK = 3.0  # times the torque that holds: by then it has broken loose


@RUNAWAY
def stuck_initial_state(shots: Shots, equations: Equations) -> None:
    """Move the start angle of a run that begins stuck to where the model fits its beginning best, in place."""
    trace = shots.trace
    reach = holding_nm(equations) / equations.jck[2] if equations.jck[2] > 0.0 else 0.0
    if not (trace.biased and reach > 0.0 and begins_at_rest(trace)):
        return
    shots.starts[0, 1] = 0.0  # what the gyro reads there is its bias
    last = _looked_at(shots, equations)
    weight = shots.weight[: last + 1]
    if not np.any(weight):
        return
    ratio = round(trace.step_s / shots.grid.step_s)
    piece = trace.piece(0, last)
    if not piece.stretches:
        return
    cut = make_shots(piece, ratio, None, weight, equations)
    shared = min(len(cut.first), len(shots.first))
    if not np.array_equal(cut.first[:shared], shots.first[:shared]):
        return
    begin = shots.starts[:shared].copy()
    cut.starts[:shared] = begin
    now, step = _loss(cut, equations, 0.0), 2.0 * reach / (STUCK_START_GRID_POINTS - 1)
    looks = {move: _loss(cut, equations, move) for move in np.linspace(-reach, reach, STUCK_START_GRID_POINTS).tolist()}
    near = min(looks, key=lambda m: looks[m])
    looks |= {near + x * step: _loss(cut, equations, near + x * step) for x in CLOSER if abs(near + x * step) <= reach}
    best = min(looks, key=lambda m: looks[m])
    if looks[best] < BETTER_START_RATIO * now:
        shots.starts[:, 0] += best


def holding_nm(equations: Equations) -> float:
    """The torque with which dry friction holds the platform at its rest angle."""
    total = 0.0
    for i, name in enumerate(equations.body):
        effect = effects.get(name)
        if effect.place is Place.FRICTION:
            out, nil = np.zeros(1), np.zeros(1)
            p = equations.p[equations.p_at[i] : equations.p_at[i + 1]].copy()
            torque_along(effect.kernel.address, nil, nil, nil, nil, 1.0, np.zeros(0), 1, p, False, 1.0, out)
            total += float(out[0])
    return total


def _loss(cut: Shots, equations: Equations, move: float) -> float:
    starts: Array = cut.starts + np.array([move, 0.0])
    residual = (cut.trace.measured - predict(cut, equations, starts, 0.0))[cut.weight]
    loss = float(np.var(residual))  # whatever the gyro's bias is
    return loss if np.isfinite(loss) else np.inf


def _looked_at(shots: Shots, equations: Equations) -> int:
    """The last sample of the part of a run that shows how it began."""
    trace = shots.trace
    inertia, _, stiffness = equations.jck.tolist()
    span = max(SPAN_S, SPAN_PERIODS * 2.0 * np.pi * float(np.sqrt(inertia / stiffness)))
    pushed = np.abs(trace.fine[3]) > SLOW_TO_BREAK * holding_nm(equations)
    breaks = trace.fine[2][int(np.argmax(pushed))] - trace.since_start_s if np.any(pushed) else 0.0
    return min(len(trace.measured) - 1, int(np.ceil((breaks + span) / trace.step_s)))
