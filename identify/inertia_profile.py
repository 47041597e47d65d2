"""Where the data hardly show the inertia: the valley of its likelihood instead of the curvature at one point.

The information matrix is the curvature of the squares at the fit. An inertia that shows weakly, in what rings there
are, has a dented likelihood: in a dent the fit stops too early, and the dent's curvature is many times that of the
valley. Fits with the inertia held at values beside it show the valley.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identify.at_rest import INERTIA, Refit, chi_square, hangs_on_rings, held_to_rest, inertia_std_error, values_of
from identify.output_error import Estimate
from identify.parameters import Name
from identify.sensitivities import jacobian
from rig.recording.run import Array

FAR = 2.0  # standard errors beside the fit, to begin with
MOST = 10  # doublings of that
RISE = 16.0  # of chi square at either end of what is looked at: dents are half as deep
COARSE = (0.5, 0.71, 0.84, 1.19, 1.41, 2.0)  # times the inertia: a deep dent may lie far from the bottom
REACH = 100.0  # standard errors: no dent is deeper in that
LEAST = 1e-3  # of the inertia: less is not looked at


class Valley(NamedTuple):
    """The squares along the inertia.

    Attributes
    ----------
    std_error
        One standard error of the inertia, as wide as the valley is.
    slope
        Change of all parameters with the inertia along the valley, (p,).
    """

    std_error: float
    slope: Array


def settled(free: Estimate, noise: float, refit: Refit) -> tuple[Estimate, Valley | None]:
    """A fit over whole runs, at the bottom of the valley where its inertia hangs on rings.

    Parameters
    ----------
    free
        The fit with its start states fitted.
    noise
        One standard deviation of the measured channel.

    Returns
    -------
    The fit, and the valley: ``free`` itself and None where the inertia is known well, or far from the noise; None also
    where the valley has no bottom.
    """
    fit = held_to_rest(free, noise, refit)
    if not hangs_on_rings(fit, noise):
        return fit, None
    bottom, valley = _bottom(fit, noise, refit)
    if bottom is not fit:  # fitted with its inertia held: information on that is none of its own
        columns = [
            jacobian(s, bottom.structure, bottom.names, bottom.values)[0] for s in bottom.shots if np.any(s.weight)
        ]
        bottom = replace(bottom, information=np.sum([x.T @ x for x in columns], axis=0))
    return bottom, valley


def widened(covariance: Array, names: tuple[Name, ...], fit: Estimate, valley: Valley) -> Array:
    """A covariance of ``names`` with the inertia as uncertain as its valley is wide, and the others along it."""
    at = names.index(INERTIA)
    slope = valley.slope[[fit.names.index(n) for n in names]]
    more = valley.std_error**2 - covariance[at, at]
    return covariance + max(more, 0.0) * np.outer(slope, slope)


def _bottom(fit: Estimate, noise: float, refit: Refit) -> tuple[Estimate, Valley | None]:
    at, rests = fit.names.index(INERTIA), _rests(fit)

    def beside(e: Estimate, inertia: float) -> Estimate:
        value = max(inertia, LEAST * float(fit.values[at]))
        return refit({**values_of(e), INERTIA: value}, rests=rests, held=[INERTIA])

    error, inertia = inertia_std_error(fit), float(fit.values[at])
    looks = [times * inertia for times in COARSE if abs(times - 1.0) * inertia < REACH * error]
    centre = min((fit, *(beside(fit, look) for look in looks)), key=lambda e: chi_square(e, noise))
    step = FAR * error
    for _ in range(MOST):
        sides = [beside(centre, float(centre.values[at]) + move) for move in (-step, step)]
        rises = [chi_square(s, noise) - chi_square(centre, noise) for s in sides]
        if min(rises) > RISE:
            break
        lowest = sides[int(np.argmin(rises))]
        if chi_square(lowest, noise) < chi_square(centre, noise):
            centre = lowest
        step *= 2.0  # over the dents, and faster where the bottom is far
    else:
        return centre, None
    below, above = (float(s.values[at]) for s in sides)
    lower = beside(centre, _vertex((below, float(centre.values[at]), above), (rises[0], 0.0, rises[1])))
    fall = chi_square(centre, noise) - chi_square(lower, noise)
    if fall > 0.0:
        centre, rises = lower, [r + fall for r in rises]
    widths = [abs(float(s.values[at] - centre.values[at])) / r**0.5 for s, r in zip(sides, rises, strict=True)]
    return centre, Valley(max(widths), (sides[1].values - sides[0].values) / (above - below))


def _rests(fit: Estimate) -> bool:
    return any(s.rests for s in fit.shots)


def _vertex(x: tuple[float, float, float], y: tuple[float, float, float]) -> float:
    """Where the parabola through three points has its lowest point; the middle one is the lowest of them."""
    if not np.all(np.isfinite(y)):
        return x[1]
    a, b, _ = np.polyfit(np.array(x) - x[1], y, 2)
    return x[1] - float(b / (2.0 * a)) if a > 0.0 else x[1]
