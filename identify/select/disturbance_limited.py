"""Whether a torque that nobody recorded limits what the runs can tell, or the sensor's noise does.

A model that lacks an effect leaves a torque, too; but an effect is a function of the motion, and its torque is
coloured. Ripple of the current, the floor, a cable have a white part that no effect has. So the declared model is
fitted by prediction error with and without a white torque: where the data insist on one, they are a real rig's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.estimate.fit import Fit
from identify.estimate.initial_guess import Start
from identify.estimate.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split
from identify.runs.reduced import reduced
from identify.signals.trace import Trace
from rig.platform import TERMS

SAMPLES = 8_000  # looked at: a white torque shows in a few thousand
LEAST = 1e-5  # of the torque: a white torque below that is none
INSISTS = 220.0  # fall of the cost: a missing effect nearly random in its band showed 200, a servo with 1 % ripple 244
MOST_LEFT = 0.15  # of the torque: a model that leaves that much is no small effect short of the sensor's noise
STEPS = 15  # of the fit


@dataclass(frozen=True)
class Regime:
    """What limits the runs, and the fit that showed it."""

    disturbance_limited: bool
    fit: Fit
    white_share: float  # of the torque, root mean square up to half the sample rate
    fall: float  # of the cost that a white torque brings


def regime_of(traces: Sequence[Trace], split: Split, structure: Structure, start: Start) -> Regime:
    """What limits the runs: the sensor's noise or a torque that nobody recorded."""
    few, _ = reduced(traces, split, SAMPLES)
    problem = PredictionError(few)
    values: dict[Name, float] = {(k,): v for k, v in zip(TERMS, start.platform, strict=True)}
    fit = problem.fit(structure, values, iterations=STEPS)
    white = float(np.sqrt(fit.noise.white / (2.0 * problem.step_s) * fit.variance)) / problem.torque_nm
    slow = float(np.sqrt(fit.noise.slow * fit.variance)) / problem.torque_nm
    if slow > MOST_LEFT:
        return Regime(True, fit, white, 0.0)
    if white < LEAST:
        return Regime(False, fit, white, 0.0)
    least = replace(fit.noise, white=problem.white(0.1 * LEAST))
    without = min(problem.cost_at(fit, replace(least, slow=least.slow * f)) for f in (1.0, 3.0, 10.0, 30.0))
    if without - fit.cost > INSISTS:  # only then is it worth its own fit
        again = problem.fit(structure, fit.values, least, iterations=STEPS, most_white=0.1 * LEAST)
        without = min(without, again.cost)
    return Regime(without - fit.cost > INSISTS, fit, white, without - fit.cost)
