"""How large the motion of a model is, and at which frequencies it is predicted wrongly: where candidates begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimate.initial_guess import scale_of
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.signals.resonances import resonances_hz
from identify.signals.spectral_lines import foreign_lines_hz, ringing_hz, rings_hz
from rig.effects.base import Scale
from rig.platform import TERMS

FOLLOWED_LINES = 2  # of the disturbance: lines at which a periodic torque is looked for beside those of what is left


def scale_at(problem: PredictionError, fit: Fit) -> Scale:
    """How large the motion is, and the lines in what a model predicts wrongly."""
    values, traces = fit.values, problem.traces
    inertia, damping, stiffness = (values.get((t,), 0.0) for t in TERMS)
    natural_hz = float(np.sqrt(max(stiffness, 0.0) / max(inertia, 1e-300)) / (2.0 * np.pi))
    left = [e[:, 0] for e in fit.prediction.innovations]
    noise = float(np.sqrt(fit.variance * problem.reading_variance))
    noise = float(np.sqrt(np.mean([np.mean(r[t.keep] ** 2) for r, t in zip(left, traces, strict=True)]))) or noise
    lines = foreign_lines_hz(traces, left, noise, natural_hz)
    # A line that the disturbance follows is none in what is left.
    followed = fit.prediction.disturbance_nm
    size_nm = float(np.sqrt(np.mean([np.mean(d[t.keep] ** 2) for d, t in zip(followed, traces, strict=True)])))
    also = foreign_lines_hz(traces, followed, size_nm, natural_hz)[:FOLLOWED_LINES] if size_nm > 0.0 else ()
    lines = (*lines, *also)
    scale = scale_of(traces, (inertia, damping, stiffness), lines, ringing_hz(traces, natural_hz))
    return replace(scale, rings_hz=rings_hz(traces, left, natural_hz), modes_hz=resonances_hz(traces, followed))
