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

LAGGING = 4  # fine steps a sample, behind a lag of the sensor, while models are compared
COARSEST = 16  # fine steps a sample while models are compared


def _behind_a_lag(step_s: float, equations: Equations) -> int:
    """Fine steps a sample that a lag of the sensor needs at most; it is exact along a parabola."""
    times = [t for values in equations.sensor.values for t in values if t > 0.0]
    return int(np.clip(np.ceil(2.0 * step_s / min(times)), LAGGING, COARSEST)) if times else LAGGING


def shots_for(
    traces: Sequence[Trace], structure: Structure, names: Sequence[Name], x: Array,
    shot_s: float | None, use: Sequence[Any] | None, carry: Sequence[Shots] | None, coarse: bool, finer: int = 1,
    rests: bool = False, ahead: bool = False,
) -> list[Shots]:  # fmt: skip
    """Every run cut into shots (see ``refine``), its steps as fine as the model needs, or ``finer`` times that.

    ``ahead``: for a prediction from sample to sample, which feeds a sensor's filter within a step, too; a simulation
    takes finer steps behind a lag.
    """
    out = []
    for i, trace in enumerate(traces):
        equations = Equations(platform_of(structure, names, x, trace.number, trace.run.added_inertia_kg_m2))
        substeps = min(MAX_SUBSTEPS, equations.substeps(trace.step_s))
        substeps = int(np.clip((substeps + 1) // 2, 1 if ahead else 2, COARSEST)) if coarse else substeps
        reads = substeps
        if equations.sensor.names:  # a lag is exact along a parabola
            most = _behind_a_lag(trace.step_s, equations) if coarse else COARSEST
            reads = int(np.clip(np.ceil(trace.step_s / trace.straight_s), substeps, max(substeps, most)))
            substeps = substeps if ahead else reads
        if trace.torque is not None and trace.torque.hold == "zero_order":
            # A step that spans several held values sees only their mean: that alone is a sigma or two.
            held = trace.step_s / trace.torque.shortest_s
            substeps = min(MAX_SUBSTEPS, max(substeps, round(held)))
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
