"""How far J, C and K are uncertain because the data do not part several models."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from identify.likelihood.fit import Fit
from rig.arrays import Array
from rig.platform import TERMS

MAX_LOG_ODDS = 50.0  # beyond, a model is all but certain


def model_spread(chosen: Fit, *rivals: Fit, ahead: Callable[[Fit, Fit], float]) -> Array:
    """Variance of J, C and K over models that the data do not part, about the chosen one, (3,).

    Each model counts by how likely it is. An interval of the chosen model alone would be as narrow as if nothing else
    could be true (Bayesian model averaging: Hoeting, Madigan, Raftery and Volinsky 1999).

    Parameters
    ----------
    ahead
        By how much the second of two models is likelier, twice a log-likelihood, as far as that can be believed.
    """
    if not rivals:
        return np.zeros(len(TERMS))
    log_odds = np.array([0.5 * (ahead(chosen, f) - ahead(f, chosen)) for f in rivals])
    odds = np.exp(np.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS))
    apart = np.array([[f.values.get((t,), 0.0) - chosen.values.get((t,), 0.0) for t in TERMS] for f in rivals])
    return np.asarray(odds @ apart**2) / (1.0 + float(np.sum(odds)))
