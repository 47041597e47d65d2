"""The gyro's bias in every run, where it is likeliest before the parameters take their first step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identify.likelihood.derivatives import OperatingPoint, derivatives
from identify.likelihood.normal_equations import COST_TOLERANCE, changed, normal_equations

if TYPE_CHECKING:
    from identify.likelihood.descent import Descent

BIAS_STEPS = 3  # at most


def settle_biases(descent: Descent) -> None:
    """Move the runs' biases to where they are likeliest with the parameters that a descent begins with.

    A model that lacks what pushes one way has it in the gyro's bias. An effect that is begun beside that bias would be
    taken back by the first step.
    """
    d = descent
    if not any(s.trace.biased for s in d.shots):
        return
    for _ in range(BIAS_STEPS):
        there = OperatingPoint(d.problem, d.structure, d.names, d.x, d.noise, d.shots, d.looks)
        found = normal_equations(derivatives(there, {}, []), len(d.x), 0, d.count, d.floor(()))
        if not all(np.all(np.isfinite(taken)) for _, taken in found.own):
            return
        shots = [changed(s, taken) for s, (_, taken) in zip(d.shots, found.own, strict=True)]
        looks = d.looks_at(d.x, d.noise, shots)
        if not (cost := d.cost_of(looks)) < d.cost - COST_TOLERANCE:
            return
        d.shots, d.looks, d.cost = shots, looks, cost
