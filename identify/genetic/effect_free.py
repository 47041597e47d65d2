"""A run with a model's effects taken off its torque: what is left obeys J a + C w + K th = M."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimate.output_error import OutputErrorFit
from identify.model.parameters import equations_of
from identify.signals.trace import Trace
from identify.simulate.shots import Shots, make_shots
from rig.dynamics import TorqueSignal
from rig.dynamics.equations import MAX_SUBSTEPS

SUBSTEP_FACTOR = 4  # times the simulator's steps: a jump's mean over one must still ring the platform as the jump did


def effect_free(trace: Trace, shots: Shots, fit: OutputErrorFit) -> Trace:
    """The run with the torque that the model leaves for its linear part, along the model's own motion.

    Along that motion friction knows when it sticks; a noisy measured rate does not.
    """
    equations = equations_of(fit.structure, fit.names, fit.vector, shots.number, shots.added)
    substeps = min(MAX_SUBSTEPS, SUBSTEP_FACTOR * equations.substeps(trace.step_s))
    fine_shots = make_shots(trace, substeps, None, None, equations)
    if np.array_equal(fine_shots.first, shots.first):
        shots, fine_shots.starts = fine_shots, shots.starts
    grid = shots.grid
    ratio = round(trace.step_s / grid.step_s)
    ends = [*shots.first[1:].tolist(), len(trace.measured) - 1]
    spans = [(a * ratio, b * ratio) for a, b in zip(shots.first.tolist(), ends, strict=True)]
    j, c, k = equations.jck
    torque = grid.shaft_torque(equations)
    mean = np.empty(len(torque) + 1)
    h = grid.step_s
    # What remembers goes on from span to span.
    motion = equations.integrate_shots(torque, h, spans, shots.starts, trace.since_start_s, trace)
    for first, last in spans:
        fine = motion[first : last + 1].copy()
        if last < len(motion) - 1 and last - first > 2:  # the next span's start stands there
            fine[-1] = 2.0 * fine[-2] - fine[-3]
        # Its mean over each fine step, exact also where dry friction makes the acceleration jump.
        turned, gained = np.diff(fine[:, 0]), np.diff(fine[:, 1])
        angle = 0.5 * (fine[1:, 0] + fine[:-1, 0]) - h * gained / 12.0
        mean[first:last] = (j * gained + c * turned) / h + k * angle
    mean[spans[-1][1] :] = mean[spans[-1][1] - 1]
    time = trace.start_s + h * np.arange(len(mean))
    return replace(trace, torque=TorqueSignal(time, mean, "zero_order"), _series={})
