"""On measured data, what the likelihood says of the candidates that the search in torque weighs.

Weight is a matter of torque along the measured motion; which of the heaviest candidates it is, and at which shapes (the
frequency of a second resonance, a lag, how a spring drifts), shows in how the platform answers. So the most promising
candidates of both views are fitted by prediction error; their shapes are weighed in torque again, and their likelihood
decides between those that weigh alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identify.estimate.fit import Fit
from identify.estimate.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores
from identify.select.stepwise import FEW, HOPE, MANY
from rig import effects
from rig.effects.base import Place, Scale

PROPOSED = 3  # candidates by the likelihood that are fitted beside the heaviest


@dataclass
class LikelihoodLook:
    """Candidates fitted by prediction error on top of one model.

    Attributes
    ----------
    problem
        The runs that are searched.
    scale
        How large the motion is.
    """

    problem: PredictionError
    scale: Scale

    def model(self, structure: Structure, values: Mapping[Name, float]) -> Fit:
        """A model that stands in torque, by prediction error."""
        return self.problem.fit(structure, values, None, MANY)

    def proposals(self, now: Fit, names: Sequence[str]) -> dict[str, dict[Name, float]]:
        """The candidates that promise most, and where their fits begin."""
        asked = [n for n in names if effects.get(n).place is not Place.SENSOR]
        price = float(np.log(max(now.count, 2)))
        looks = InnovationScores(self.problem, now, self.scale).all(asked)
        worth = [v[0] for v in looks if v[0].gain > HOPE + price * len(effects.get(v[0].effect).parameters)]
        return {s.effect: s.start for s in worth[:PROPOSED]}

    def fitted(self, now: Fit, name: str, start: Mapping[Name, float]) -> Fit | None:
        """One candidate more."""
        fit = self.problem.fit(now.structure.plus(name), {**now.values, **start}, now.noise, FEW, carry=now.shots)
        return fit if np.isfinite(fit.cost) else None


def shape_of(fit: Fit, name: str) -> tuple[float, ...]:
    """The shapes of an effect as a fit has them."""
    return tuple(fit.values[(name, p.name)] for p in effects.get(name).parameters if not p.linear)
