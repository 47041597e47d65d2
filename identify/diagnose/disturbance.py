"""The residual as a torque: its size, what it depends on, and how far that changes J, C and K.

Every rig has a disturbance: current ripple, the floor, a cable. The part that goes with nothing is noise and is in the
intervals. The part that goes with angle, rate, direction, torque, time or history is something the model lacks; a
free-form term (a spline) beside the model takes it up, and how far J, C and K move with it is their honest error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import norm

from identify.diagnose.terms.changing import along_angle, pulsating
from identify.diagnose.terms.curves import curves
from identify.diagnose.terms.free_form import FreeForm
from identify.diagnose.terms.from_run_to_run import FROM_RUN_TO_RUN, between_runs, moved_on_average
from identify.diagnose.terms.in_steps import in_steps
from identify.diagnose.terms.repeating import repeating
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.model.parameters import Name
from identify.results import Dependence, Disturbance
from rig.arrays import Array
from rig.platform import TERMS

DEPENDENCE_SIGMAS = 4.0  # standard errors over blocks of held-out samples; by chance once in 30,000
MIN_POWER_SHARE = 0.02  # of the power that is left: less is not worth a word
MIN_OVER_NOISE = 2.0  # times what the term makes of the sensor's noise alone: an integrated rate wanders with that
MOST_OF_IT = 2.0**0.5  # times the largest other part: what repeats is told where no curve shows half of its power
ABOUT = 1.0 / 16.0  # of the angle's range, to either side of the start: the spring there, and not a ripple on it
MISSING_IN_RUNS, MISSING_SHARE = 0.25, 0.25  # runs in which a wave may be missing: with less of its share in all


def disturbance_of(
    regression: TorqueRegression, fit: TorqueFit, floor_nm: float, unit: str, on: str = ""
) -> Disturbance:  # fmt: skip
    """What a model leaves of the torque.

    Parameters
    ----------
    regression, fit
        The final model in torque.
    floor_nm
        What the sensor's noise alone leaves, root mean square.
    on
        Quantity that is asked about; every one where none is given.
    """
    left = float(np.sqrt(max(fit.held_nm**2 - floor_nm**2, 0.0)))
    relative = left / max(regression.torque_nm, 1e-300)
    terms = curves(regression, fit)
    found = _depends(regression, fit, [t for t in terms if t.on != "torque"])
    over_torque = [t for t in terms if t.on == "torque"]
    both = _depends(regression, fit, over_torque)
    if both and len(both) == len(over_torque):
        found.append(min(both, key=lambda f: f[0].torque_rms))
    # Where a trajectory repeats, these follow what anything else explains: they count where they explain more.
    most = max((f[0].torque_rms for f in found), default=0.0)
    follow = [*along_angle(regression), *between_runs(regression, fit)]
    found += [f for f in _depends(regression, fit, follow) if f[0].torque_rms > most]
    found += [f for f in _depends(regression, fit, repeating(regression)) if f[0].torque_rms > MOST_OF_IT * most]
    most = max((f[0].torque_rms for f in found), default=0.0)
    found += [f for f in _depends(regression, fit, in_steps(regression, fit)) if f[0].torque_rms > MOST_OF_IT * most]
    # What pulsates may follow, as a change over time, what an angle or a rate explains by itself, too.
    most = max((f[0].torque_rms for f in found), default=0.0)
    found += [f for f in _depends(regression, fit, pulsating(regression, fit)) if f[0].torque_rms > MOST_OF_IT * most]
    found.sort(key=lambda f: -f[0].torque_rms)
    found = [f for i, f in enumerate(found) if f[0].on not in [g[0].on for g in found[:i]]]
    found = [f for f in found if on in ("", f[0].on)]
    moves = _moves(fit, [moved for _, moved in found])
    return Disturbance(left, unit, relative, tuple(d for d, _ in found), moves)


def beside(regression: TorqueRegression, fit: TorqueFit, part: Dependence, other: TorqueFit) -> tuple[TorqueFit, ...]:
    """A model and another one, each with the free-form term by which a part of the first one's residual was found.

    Nothing where that part was found by another way than in torque.
    """
    every = (
        *curves(regression, fit), *along_angle(regression), *between_runs(regression, fit), *repeating(regression),
        *pulsating(regression, fit), *in_steps(regression, fit),
    )  # fmt: skip
    same = [
        t for t in every
        if (t.on, t.changes, t.wave_on, t.step_nm is None)
        == (part.on, part.changes, part.wave_on, part.step_nm is None)
    ]  # fmt: skip
    if not same:
        return ()
    tried = [[regression.beside(f, t)[0] for t in same] for f in (fit, other)]
    return tuple(min(fits, key=lambda f: f.held_nm) for fits in tried)


def _depends(
    regression: TorqueRegression, fit: TorqueFit, terms: Sequence[FreeForm]
) -> list[tuple[Dependence, Mapping[Name, float]]]:  # fmt: skip
    """Those of several terms that the residual goes with."""
    return [found for term in terms if (found := _dependence(regression, fit, term)) is not None]


def _dependence(
    regression: TorqueRegression, fit: TorqueFit, term: FreeForm
) -> tuple[Dependence, Mapping[Name, float]] | None:  # fmt: skip
    """What of the residual goes with a term, and how far the parameters move; None where held-out samples show none."""
    richer, gains, penalty = regression.beside(fit, term)
    # What is fitted to each run is held out by blocks, and so is what it stands beside.
    alone = regression.beside(fit, term.without_columns())[0] if term.of_each_run else fit
    sure = max(regression.fall_in_sigmas(alone, richer, of_each_run=term.changes == FROM_RUN_TO_RUN))
    share = 1.0 - richer.held_nm**2 / max(alone.held_nm**2, 1e-300)
    if share < MIN_POWER_SHARE or sure < DEPENDENCE_SIGMAS:
        return None
    if term.wave_on and not _in_most_runs(alone, richer, share):
        return None
    size = float(np.sqrt(share)) * alone.held_nm
    made_nm = (
        term.noise_nm() if term.noise_nm else regression.made_by_noise_nm(fit.values, term.columns, term.ridge(penalty))
    )
    if size < MIN_OVER_NOISE * made_nm:
        return None
    at, shape_nm = tuple(term.at.tolist()), tuple((term.shape @ gains).tolist())
    found = Dependence(
        term.on, size, size / regression.torque_nm, float(norm.sf(sure)), at, shape_nm, term.wave_on, term.wave_hz,
        term.changes, term.step_nm,
    )  # fmt: skip
    return found, _moved(regression, fit, richer, term, gains)


def _in_most_runs(fit: TorqueFit, richer: TorqueFit, share: float) -> bool:
    """Whether three quarters of the runs show it: what acts from outside acts in all, a harmonic of one excitation does
    not. ``share`` is that of all runs together."""
    pairs = zip(fit.held, richer.held, strict=True)
    falls = [1.0 - float(np.sum(new**2)) / max(float(np.sum(old**2)), 1e-300) for old, new in pairs]
    return float(np.quantile(falls, MISSING_IN_RUNS)) > MISSING_SHARE * share


def _moved(
    regression: TorqueRegression, fit: TorqueFit, richer: TorqueFit, term: FreeForm, gains: Array
) -> Mapping[Name, float]:  # fmt: skip
    """By how much parameters are others with a free-form term beside them.

    The stiffness is that about the start angle: what the term adds to the slope there is part of it.
    """
    if term.changes == FROM_RUN_TO_RUN:
        return moved_on_average(regression, fit, richer, term.columns, gains)
    moved = {n: v - fit.values[n] for n, v in richer.values.items() if n in fit.values}
    if term.on == "angle" and term.at.size and ("stiffness",) in moved:
        start = float(np.clip(0.0, term.at[0], term.at[-1]))
        ends = np.clip([start - ABOUT * np.ptp(term.at), start + ABOUT * np.ptp(term.at)], term.at[0], term.at[-1])
        moved[("stiffness",)] += float(np.diff(np.interp(ends, term.at, term.shape @ gains))[0] / np.ptp(ends))
    return moved


def _moves(fit: TorqueFit, moved: Sequence[Mapping[Name, float]]) -> Mapping[str, float]:
    """How far J, C and K move with the free-form term of what is left beside the model, in percent: the most of any."""
    out: dict[str, float] = {}
    for by in moved:
        for name in TERMS:
            here = fit.values.get((name,))
            if here:
                out[name] = max(out.get(name, 0.0), 100.0 * abs(by.get((name,), 0.0) / here))
    return out
