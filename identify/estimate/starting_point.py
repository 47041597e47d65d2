"""Where an output-error fit begins: its values from a regression, and how far ahead it predicts at first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.estimate.regression import RegressionFit
from identify.model.parameters import Name, names_of
from identify.model.structure import Shapes
from identify.signals.trace import Trace
from rig import effects


def horizon_s(platform: tuple[float, float, float], traces: Sequence[Trace]) -> float:
    """How far ahead a model has to predict while models are compared.

    Three periods of an oscillation, or the time constant of a platform without a spring: long enough for
    a missing effect to show, short enough that a model which is still wrong stays near the data.
    """
    j, c, k = platform
    shortest = 40.0 * max(t.step_s for t in traces)
    longest = 0.25 * min(t.step_s * len(t.measured) for t in traces)
    swings = k > 0.0 and c * c < 4.0 * j * k and np.sqrt(k / j) * longest > np.pi
    wanted = 6.0 * np.pi * np.sqrt(j / k) if swings else float(np.clip(j / max(abs(c), 1e-12), 0.3, 1.0))
    return float(np.clip(wanted, shortest, max(longest, shortest)))


def start_values(solution: RegressionFit, shapes: Shapes, runs: int) -> dict[Name, float]:
    """A start for output error from a solved regression."""
    inertia, damping, stiffness = solution.jck
    terms = {"inertia": inertia, "damping": damping, "stiffness": stiffness}
    out: dict[Name, float] = {}
    for name in names_of(solution.structure, runs):
        if len(name) == 1:
            out[name] = terms[name[0]]
            continue
        effect = effects.get(name[0])
        parameter = next(p for p in effect.parameters if p.name == name[1])
        if parameter.linear:
            out[name] = float(np.clip(solution.values.get(name, 0.0), parameter.low, parameter.high))
        else:
            index = [p.name for p in effect.parameters if not p.linear].index(name[1])
            out[name] = float(shapes[name[0]][index])
    return out
