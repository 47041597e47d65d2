"""The residual as a torque: its size, what it depends on, and how far that changes J, C and K.

Every rig has a disturbance: current ripple, the floor, a cable. The part that goes with nothing is noise and is in the
intervals. The part that goes with angle, rate, direction, torque, time or history is something the model lacks; a
free-form term (a spline) beside the model takes it up, and how far J, C and K move with it is their honest error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.stats import norm

from identify.diagnose.torque_regression import TorqueFit, TorqueRegression
from identify.results import Dependence, Disturbance
from rig.arrays import Array
from rig.platform import TERMS

KNOTS = 7  # inner knots of a spline, at even shares of the samples
SURE = 4.0  # standard errors over blocks of held-out samples; by chance once in 30,000
LEAST = 0.02  # of the power that is left: less is not worth a word
SHOWN = 25  # places at which a term's shape is given
PAST_S = (0.05, 0.5)  # of the run: time constants with which a rate is remembered


@dataclass(frozen=True)
class FreeForm:
    """A free-form term: its columns at every sample, and where its shape is shown."""

    on: str
    columns: Array  # (n, k)
    at: Array
    shape: Array  # (SHOWN, k)


def disturbance_of(regression: TorqueRegression, fit: TorqueFit, floor_nm: float, unit: str) -> Disturbance:
    """What a model leaves of the torque.

    Parameters
    ----------
    regression, fit
        The final model in torque.
    floor_nm
        What the sensor's noise alone leaves, root mean square.
    """
    left = float(np.sqrt(max(fit.held_nm**2 - floor_nm**2, 0.0)))
    relative = left / max(regression.torque_nm, 1e-300)
    found: list[tuple[Dependence, FreeForm]] = []
    for term in free_forms(regression):
        richer, gains = regression.following(fit, term.columns)
        by_size, by_ratio = regression.sureness(fit, richer)
        sure = max(by_size, by_ratio)
        share = 1.0 - richer.held_nm**2 / max(fit.held_nm**2, 1e-300)
        if share < LEAST or sure < SURE:
            continue
        size = float(np.sqrt(share)) * fit.held_nm
        found.append((
            Dependence(
                term.on, size, size / regression.torque_nm, float(norm.sf(sure)), tuple(term.at.tolist()),
                tuple((term.shape @ gains).tolist()),
            ), term,
        ))  # fmt: skip
    found.sort(key=lambda f: -f[0].torque_rms)
    moves = _moves(regression, fit, [t for _, t in found])
    return Disturbance(left, unit, relative, tuple(d for d, _ in found), moves)


def _moves(regression: TorqueRegression, fit: TorqueFit, terms: Sequence[FreeForm]) -> Mapping[str, float]:
    """How far J, C and K move with the free-form term of what is left beside the model, in percent: the most of any."""
    out: dict[str, float] = {}
    for term in terms:
        _, gains = regression.following(fit, term.columns)
        moved = regression.moved_by(fit, term.columns @ gains)
        for name in TERMS:
            here = fit.values.get((name,))
            if here:
                out[name] = max(out.get(name, 0.0), 100.0 * abs(moved.get((name,), 0.0) / here))
    return out


def free_forms(regression: TorqueRegression) -> list[FreeForm]:
    """The terms that are tried, without what the linear model has of the same quantity."""
    angle, rate, _, torque, time, run = regression.series()
    slow = 0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300
    driven = [] if regression.torque_free else [_spline("torque", torque)]
    out = [
        _spline("angle", angle), _spline("rate", rate), *driven,
        FreeForm("direction", np.tanh(rate / slow)[:, None], np.array([-1.0, 1.0]), np.array([[-1.0], [1.0]])),
    ]  # fmt: skip
    if float(np.max(time)) > 0.0:
        out.append(_spline("time", time))
    out.append(_history(rate, run, regression))
    return [f for f in out if f.columns.shape[1] > 0 and np.all(np.isfinite(f.columns))]


def _spline(on: str, x: Array) -> FreeForm:
    """Cubic splines of a quantity with what is constant and linear in it taken out."""
    inner = np.unique(np.quantile(x, np.linspace(0.0, 1.0, KNOTS + 2)))
    if len(inner) < 4:
        return FreeForm(on, np.zeros((len(x), 0)), np.zeros(0), np.zeros((0, 0)))
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])

    def basis(values: Array) -> Array:
        return np.asarray(BSpline.design_matrix(np.clip(values, inner[0], inner[-1]), knots, 3).toarray())

    def straight(values: Array) -> Array:
        return np.column_stack([np.ones(len(values)), values])

    columns = basis(x)
    line = np.linalg.lstsq(straight(x), columns, rcond=None)[0]
    at = np.linspace(inner[0], inner[-1], SHOWN)
    free = columns - straight(x) @ line
    _, s, v = np.linalg.svd(free, full_matrices=False)
    keep = s > 1e-6 * s[0]
    shape = (basis(at) - straight(at) @ line) @ v[keep].T
    return FreeForm(on, free @ v[keep].T, at, shape)


def _history(rate: Array, run: Array, regression: TorqueRegression) -> FreeForm:
    """The direction of the motion as it was a while ago, with two lengths of memory."""
    direction = np.tanh(rate / (0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300))
    out = np.zeros((len(rate), len(PAST_S)))
    for k in np.unique(run):
        here = np.nonzero(run == k)[0]
        for j, share in enumerate(PAST_S):
            memory, decay = 0.0, float(np.exp(-1.0 / max(share * 0.1 * len(here), 1.0)))
            for i in here:
                memory = decay * memory + (1.0 - decay) * direction[i]
                out[i, j] = memory
    return FreeForm("history", out, np.zeros(0), np.zeros((0, len(PAST_S))))
