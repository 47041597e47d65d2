"""A final fit whose values and covariance are given."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identify.estimate.final_fit import FinalFit
from identify.model.parameter_fit import ParameterFit
from identify.model.parameters import Name
from identify.model.structure import Structure
from rig.recording.run import Array


def final_fit(structure: Structure, values: Mapping[Name, float], covariance: Array) -> FinalFit:
    """All parameters determined."""
    names, vector = tuple(values), np.array(list(values.values()))
    fit = ParameterFit(structure, names, vector, 1000, 1.0, 1000.0, np.eye(len(names)))
    return FinalFit(fit, values, names, covariance, None, True, (True,) * len(names), "")
