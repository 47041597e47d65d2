"""Where the data hardly show the inertia: the valley of its likelihood instead of the curvature at one point.

The information matrix is the curvature of the squares at the fit. An inertia that shows weakly, in what rings there
are, has a dented likelihood: in a dent the fit stops too early, and the dent's curvature is many times that of the
valley. Fits with the inertia held at values beside it show the valley.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identify.estimate.output_error import OutputErrorFit
from identify.estimate.started_at_rest import (
    INERTIA,
    Refit,
    depends_on_ringing,
    inertia_std_error,
    is_quasi_static,
    near,
    with_fixed_initial_state,
)
from identify.model.parameters import Name, bounds_of, ordered
from identify.signals.torque_bandwidth import highest_torque_hz
from identify.simulate.sensitivities import jacobian
from identify.simulate.shots import RUNAWAY, residual_at
from rig.platform import TERMS
from rig.recording.run import Array

INITIAL_STEP_SIGMAS = 2.0  # standard errors beside the fit, to begin with
MAX_DOUBLINGS = 10  # doublings of that
RISE = 25.0  # of chi square at either end of what is looked at: dents are half as deep
BOUND = 4.0  # of chi square at an end beyond which nothing is to be looked at: a 95 % interval ends before it
INNER_GRID_POINTS = 11  # between the ends
COARSE = (0.5, 0.71, 0.84, 1.19, 1.41, 2.0)  # times the inertia: a deep dent may lie far from the bottom
MAX_DENT_SIGMAS = 100.0  # standard errors: no dent is deeper in that
DEEP = 20.0  # of chi square: no chance makes a dent of that
MAX_GRID_POINTS = 800  # a damping ratio apart, which is how narrow a ring makes them
MIN_INERTIA_SHARE = 1e-3  # of the inertia: less is not looked at


class ProfileLikelihood(NamedTuple):
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


def settled(free: OutputErrorFit, refit: Refit) -> tuple[OutputErrorFit, ProfileLikelihood | None]:
    """A fit over whole runs, at the bottom of the valley where its inertia hangs on rings.

    Parameters
    ----------
    free
        The fit with its start states fitted.

    Returns
    -------
    The fit, and the valley: ``free`` itself and None where the inertia is known well, or far from the noise; None also
    where the torque makes the platform ring, which tells the inertia.
    """
    held = with_fixed_initial_state(free, refit)
    fit = _out_of_a_dent(held, refit)
    if fit is held and not depends_on_ringing(fit):
        return fit, None
    bottom, valley = _bottom(fit, refit)
    return bottom if bottom is fit else _informed(bottom), valley


def widened(covariance: Array, names: tuple[Name, ...], fit: OutputErrorFit, valley: ProfileLikelihood) -> Array:
    """A covariance of ``names`` with the inertia as uncertain as its valley is wide, and the others along it."""
    at = names.index(INERTIA)
    slope = valley.slope[[fit.names.index(n) for n in names]]
    more = valley.std_error**2 - covariance[at, at]
    return covariance + max(more, 0.0) * np.outer(slope, slope)


def _out_of_a_dent(fit: OutputErrorFit, refit: Refit) -> OutputErrorFit:
    """The fit, or one far up the valley from it where nothing but a dent that chance can make held it.

    Shaken far below its resonance a platform of too little inertia and no damping rings on and on, however small the
    ring: in that it follows the noise, and knows its inertia to a thousandth of a percent.
    """
    if not (_rests(fit) and near(fit) and is_quasi_static(fit)):
        return fit
    fastest = 2.0 * np.pi * max(highest_torque_hz(s.trace) for s in fit.shots)
    if not fastest > 0.0:
        return fit
    values = fit.values
    inertia = values[INERTIA]
    most = values[("stiffness",)] / fastest**2  # it would resonate with the torque
    looks = inertia * np.exp2(np.arange(1.0, np.log2(most / inertia)))
    seen = [refit({**values, INERTIA: float(x)}, rests=True, held=[INERTIA], carry=fit.shots) for x in looks]
    best = min(seen, key=lambda e: e.cost, default=fit)
    return _informed(best) if best.cost < fit.cost + DEEP else fit


def _informed(fit: OutputErrorFit) -> OutputErrorFit:
    """A fit whose inertia was held, of which it has no information of its own, with that of all its parameters."""
    columns = [jacobian(s, fit.structure, fit.names, fit.vector)[0] for s in fit.shots if np.any(s.weight)]
    return replace(fit, information=np.sum([x.T @ x for x in columns], axis=0))


def _bottom(fit: OutputErrorFit, refit: Refit) -> tuple[OutputErrorFit, ProfileLikelihood | None]:
    rests = _rests(fit)

    def beside(e: OutputErrorFit, inertia: float) -> OutputErrorFit:
        value = max(inertia, MIN_INERTIA_SHARE * fit.values[INERTIA])
        return refit({**e.values, INERTIA: value}, rests=rests, held=[INERTIA], carry=e.shots)

    error, inertia = inertia_std_error(fit), fit.values[INERTIA]
    looks = [times * inertia for times in COARSE if abs(times - 1.0) * inertia < MAX_DENT_SIGMAS * error]
    centre = min((fit, *(beside(fit, look) for look in looks)), key=lambda e: e.cost)
    step = INITIAL_STEP_SIGMAS * error
    least = MIN_INERTIA_SHARE * inertia
    for _ in range(MAX_DOUBLINGS):
        middle = centre.values[INERTIA]
        sides = [beside(centre, middle + move) for move in (-step, step)]
        rises = [s.cost - centre.cost for s in sides]
        at_the_end = middle - step <= least and rises[1] > RISE  # lighter than nothing it is not
        if min(rises) > RISE or at_the_end:
            break
        lowest = sides[int(np.argmin(rises))]
        if lowest.cost < centre.cost:
            centre = lowest
        step *= 2.0  # over the dents, and faster where the bottom is far
    slope = (sides[1].vector - sides[0].vector) / (sides[1].values[INERTIA] - sides[0].values[INERTIA])
    if not min(rises) > BOUND:
        return centre, ProfileLikelihood(centre.values[INERTIA], slope)  # open on one side: nothing is known of it
    centre, std_error = _vertex(centre, [beside(centre, look) for look in _between(sides)], sides, beside)
    found = _where_it_rings(centre, slope, refit) if rests else None
    if found is not None:
        return found, None
    return centre, ProfileLikelihood(std_error, slope)


def _between(sides: Sequence[OutputErrorFit]) -> list[float]:
    below, above = (s.values[INERTIA] for s in sides)
    return np.linspace(below, above, INNER_GRID_POINTS + 2)[1:-1].tolist()


def _vertex(
    centre: OutputErrorFit, looks: Sequence[OutputErrorFit], sides: Sequence[OutputErrorFit],
    beside: Callable[[OutputErrorFit, float], OutputErrorFit],
) -> tuple[OutputErrorFit, float]:  # fmt: skip
    """The fit at the vertex of the parabola through all that was looked at, and the standard error of its width.

    What noise does to a start state makes the squares a little smaller at every inertia, here more and there less:
    the lowest point is the luckiest one.
    """
    seen = [e for e in (*sides, *looks) if np.isfinite(e.sigma)]
    x = np.array([e.values[INERTIA] for e in seen])
    middle, half = centre.values[INERTIA], 0.5 * float(np.ptp(x))
    a, b, _ = np.polyfit((x - middle) / half, [e.cost - centre.cost for e in seen], 2)
    if not a > 0.0:
        return centre, half
    vertex = middle - half * float(b / (2.0 * a))
    inside = min(max(vertex, float(np.min(x))), float(np.max(x)))
    return beside(centre, inside), half / float(np.sqrt(a))


def _where_it_rings(centre: OutputErrorFit, slope: Array, refit: Refit) -> OutputErrorFit | None:
    """The fit in the one deep dent that a ring of the platform makes, if there is one; it is as narrow as the ring.

    Runs that are held to rest have no rings but those which their torque makes: a soft start leaves a small one, of
    which the valley's bottom knows nothing. Chance makes no dent that deep.
    """
    names, noise = centre.names, centre.noise
    inertia, damping, stiffness = (centre.values.get((t,), 0.0) for t in TERMS)
    if not (damping > 0.0 and stiffness > 0.0):
        return None
    ratio = float(damping / (2.0 * np.sqrt(stiffness * inertia)))
    looks = inertia * np.exp(np.arange(np.log(COARSE[0]), np.log(COARSE[-1]), ratio))
    if not 1 < len(looks) < MAX_GRID_POINTS:
        return None
    low, high = (np.array([bounds_of(n, names)[i] for n in names]) for i in (0, 1))
    moved = [ordered(names, np.clip(centre.vector + slope * (look - inertia), low, high)) for look in looks]
    squares = [_squares_along(centre, x) / noise**2 for x in moved]
    best = int(np.argmin(squares))
    if squares[best] > _squares_along(centre, centre.vector) / noise**2 - DEEP / 2.0:
        return None  # between two looks it may be twice as deep
    found = refit(dict(zip(names, moved[best].tolist(), strict=True)), rests=True)
    return found if found.cost < centre.cost - DEEP else None


@RUNAWAY
def _squares_along(fit: OutputErrorFit, x: Array) -> float:
    """Squares of the runs at other parameters, their biases fitted."""
    total = 0.0
    for s in fit.shots:
        residual = residual_at(s, fit.structure, fit.names, x)[0][s.weight]
        total += float(np.sum((residual - np.mean(residual)) ** 2)) if len(residual) else 0.0
    return total if np.isfinite(total) else np.inf


def _rests(fit: OutputErrorFit) -> bool:
    return any(s.rests for s in fit.shots)
