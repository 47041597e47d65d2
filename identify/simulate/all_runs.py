"""All runs of a recording cut into shots, with steps as fine as a model needs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.model.parameters import Name, platform_of
from identify.model.structure import Structure
from identify.signals.trace import Trace
from identify.simulate.shots import Shots, from_rest, make_shots, may_rest
from identify.simulate.stuck_start import stuck_initial_state
from rig.dynamics import Equations
from rig.dynamics.equations import MAX_SUBSTEPS
from rig.recording.run import Array

COARSEST = 16  # fine steps a sample while models are compared
READ_BIAS = 0.3  # standard errors of a parameter, by which what a lag is fed may move it
PARTS_AT_TURNS = 4  # fine steps a sample: a torque that steps within leaves 0.1 % of C, 0.7 % where there is one
PARTS_OF_A_LAG = 8  # read so often within its time, a lag has its own effect of second order to a quarter percent


def reads_a_sample(trace: Trace, lag_s: float, samples: int) -> float:
    """How often a sample a lag of the sensor has to be fed, which takes the rate for straight in between.

    Of a rate whose second derivative is b its output is off by b d^2 / 12, d being the interval, or by b d T / 2 behind
    a lag T that is shorter. What is off repeats with the motion and does not average out as noise does, so it may be no
    more than the noise of a mean over all ``samples``.
    """
    least = READ_BIAS * trace.noise / (np.sqrt(samples) * max(trace.bend_rad_s3, 1e-300))
    straight_s = np.sqrt(12.0 * least)
    if lag_s > 0.0:
        straight_s = max(straight_s, 2.0 * least / lag_s, lag_s / PARTS_OF_A_LAG)
    return float(trace.step_s / max(straight_s, 1e-300))


def shots_for(
    traces: Sequence[Trace], structure: Structure, names: Sequence[Name], x: Array,
    shot_s: float | None, use: Sequence[Any] | None, carry: Sequence[Shots] | None, coarse: bool, finer: int = 1,
    rests: bool = False, ahead: bool = False,
) -> list[Shots]:  # fmt: skip
    """Every run cut into shots (see ``refine``), its steps as fine as the model needs, or ``finer`` times that.

    ``ahead``: for a prediction from sample to sample, which follows a low-pass of the sensor exactly and feeds another
    filter within a step, too; a simulation takes finer steps behind a lag.
    """
    out = []
    samples = sum(len(trace.measured) for trace in traces)
    for i, trace in enumerate(traces):
        equations = Equations(platform_of(structure, names, x, trace.number, trace.run.added_inertia_kg_m2))
        substeps = min(MAX_SUBSTEPS, equations.substeps(trace.step_s))
        substeps = int(np.clip((substeps + 1) // 2, 1 if ahead else 2, COARSEST)) if coarse else substeps
        reads = substeps
        if equations.sensor.names:
            lag_s = sum(t for values in equations.sensor.values for t in values)
            most = max(substeps, COARSEST)
            reads = int(np.clip(np.ceil(reads_a_sample(trace, lag_s, samples)), substeps, most))
            substeps = substeps if ahead else reads
        if trace.torque is not None and trace.torque.hold == "zero_order":
            # A step that spans several held values sees only their mean: that alone is a sigma or two.
            held = trace.step_s / trace.torque.shortest_s
            substeps = min(MAX_SUBSTEPS, max(substeps, round(held)))
            # What steps within a step is a straight line there. Friction turns the platform at another instant then,
            # and what it has pushed until then is another impulse.
            if equations.sticks and not trace.torque.steps_on(trace.start_s, trace.step_s):
                substeps = min(MAX_SUBSTEPS, max(substeps, PARTS_AT_TURNS))
        substeps = min(MAX_SUBSTEPS, finer * substeps)
        length = None if shot_s is None else max(8, round(shot_s / trace.step_s))
        counting = None if use is None else use[i]
        held = may_rest(trace, equations) and (rests if carry is None else carry[i].rests)
        shots = from_rest(make_shots(trace, substeps, length, counting, equations, held), equations)
        shots.reads = -(-reads // substeps) if ahead else 1
        if carry is not None and np.array_equal(carry[i].first, shots.first):
            shots.starts, shots.bias = carry[i].starts.copy(), carry[i].bias
        elif length is None and equations.sticks:
            stuck_initial_state(shots, equations)
        out.append(shots)
    return out
