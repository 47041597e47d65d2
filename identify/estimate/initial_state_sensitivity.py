"""Standard errors of a single run that do not lean on a ring which its fitted start state may only seem to have.

A platform with a spring rings from any start state that is not part of its steady motion, and a ring tells inertia
and stiffness apart. The fitted start state carries the sensor's noise: where the true motion has no ring, the fitted
one still has a small one, and the information matrix at the fit takes it for a fact. So the start state is moved
within its own uncertainty to where the run tells least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.estimate.output_error import OutputErrorFit
from identify.model.parameters import Name
from identify.simulate.sensitivities import jacobian, sensitivities
from identify.simulate.shots import Shots
from rig.recording.run import Array

DOUBT = 4.0  # standard errors by which a start state may be off
ELLIPSE_GRID_POINTS = 25  # points across the ellipse, either way


def least_std_errors(shots: Shots, fit: OutputErrorFit, names: Sequence[Name], sigma: float) -> Array:
    """Standard errors of ``names`` where the start state of one run tells least, (p,).

    Parameters
    ----------
    shots
        The run, its start state fitted. Of a run in several pieces only the longest piece's is moved.
    sigma
        One standard deviation of the measured channel's noise.
    """
    keep = [fit.names.index(n) for n in names]
    which = int(np.argmax(shots.counts))
    along = _directions(shots, fit, which) * sigma

    def columns(by: Array) -> Array:
        starts = shots.starts.copy()
        starts[which] += by
        return jacobian(replace(shots, starts=starts), fit.structure, fit.names, fit.vector)[0][:, keep]

    here = columns(np.zeros(2))
    parts = [here, *(columns(d) - here for d in along.T)]  # the motion is linear in its start state, nearly
    gram = np.array([[a.T @ b for b in parts] for a in parts])
    if not np.all(np.isfinite(gram)):  # a model that runs away tells nothing about itself
        return np.full(len(keep), np.inf)
    reach = np.linspace(-DOUBT, DOUBT, ELLIPSE_GRID_POINTS)
    points = np.array([(1.0, u, v) for u in reach for v in reach if np.hypot(u, v) <= DOUBT])
    size = np.sqrt(np.maximum(np.diag(gram[0, 0]), 1e-300))
    scaled = np.einsum("ka,kb,abij->kij", points, points, gram) / np.outer(size, size)
    inverses = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    return np.asarray(np.sqrt(np.max(np.diagonal(inverses, axis1=1, axis2=2), axis=0)) * sigma / size)


def _directions(shots: Shots, fit: OutputErrorFit, which: int) -> Array:
    """Axes of the start state's uncertainty for unit noise, one a column, (2, 2)."""
    p = len(fit.names)
    _, state, _ = sensitivities(shots, fit.structure, fit.names, fit.vector, np.ones(p), np.ones(p, dtype=bool))
    begin, end = shots.edges[which]
    z = state[begin:end][shots.weight[begin:end]]
    square = z.T @ z
    if not np.all(np.isfinite(square)):
        return np.zeros((2, 2))
    spread, axes = np.linalg.eigh(np.linalg.pinv(square, hermitian=True))
    return np.asarray(axes * np.sqrt(np.maximum(spread, 0.0)))
