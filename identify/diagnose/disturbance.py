"""The residual as a torque: its size, what it depends on, and how far that changes J, C and K.

Every rig has a disturbance: current ripple, the floor, a cable. The part that goes with nothing is noise and is in the
intervals. The part that goes with angle, rate, direction, torque, time or history is something the model lacks; a
free-form term (a spline) beside the model takes it up, and how far J, C and K move with it is their honest error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.stats import norm

from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.model.parameters import Name
from identify.results import Dependence, Disturbance
from rig.arrays import Array
from rig.platform import TERMS

SPLINE_KNOTS = 7  # inner knots of a spline, at even shares of the samples
DEPENDENCE_SIGMAS = 4.0  # standard errors over blocks of held-out samples; by chance once in 30,000
MIN_POWER_SHARE = 0.02  # of the power that is left: less is not worth a word
MIN_OVER_NOISE = 2.0  # times what the term makes of the sensor's noise alone: an integrated rate wanders with that
SHAPE_POINTS = 25  # places at which a curve's shape is given
OUTER = (0.8, 0.95)  # shares of the samples inside of which nothing is touched
MISSING_IN_RUNS, MISSING_SHARE = 0.25, 0.25  # runs in which a wave may be missing: with less of its share in all
MIN_PERIODS = 3.0  # in the longest run, of what changes as a wave: a slower change is one over the time itself
PAST_RUN_SHARES = (0.05, 0.5)  # of the run: time constants with which a rate is remembered


@dataclass(frozen=True)
class FreeForm:
    """A free-form term: its columns at every sample, and where its shape is shown."""

    on: str
    columns: Array  # (n, k)
    at: Array
    shape: Array  # (SHAPE_POINTS, k)
    of_each_run: bool = False  # columns that belong to one run each
    wave_on: str = ""
    wave_hz: float | None = None
    changes: str = ""


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
    found = [f for term in free_forms(regression) if (f := _dependence(regression, fit, term)) is not None]
    # Where a trajectory repeats, these follow what anything else explains: they count where they explain more.
    most = max((f[0].torque_rms for f in found), default=0.0)
    along = [f for term in _along_angle(regression) if (f := _dependence(regression, fit, term)) is not None]
    found += [f for f in along if f[0].torque_rms > most]
    if not found:  # asked last: it may follow, as a change over time, what an angle or a rate explains by itself
        found = [f for term in _pulsating(regression, fit) if (f := _dependence(regression, fit, term)) is not None]
    found.sort(key=lambda f: -f[0].torque_rms)
    found = [f for i, f in enumerate(found) if f[0].on not in [g[0].on for g in found[:i]]]
    moves = _moves(fit, [moved for _, moved in found])
    return Disturbance(left, unit, relative, tuple(d for d, _ in found), moves)


def _dependence(
    regression: TorqueRegression, fit: TorqueFit, term: FreeForm
) -> tuple[Dependence, Mapping[Name, float]] | None:  # fmt: skip
    """What of the residual goes with a term, and how far the parameters move; None where held-out samples show none."""
    if term.on == "torque":  # what is explained is a torque: with the parameters free, it would explain itself
        richer, gains = regression.following(fit, term.columns)
    else:
        richer, gains = regression.beside(fit, term.columns, term.of_each_run)
    by_size, by_ratio = regression.fall_in_sigmas(fit, richer)
    sure = max(by_size, by_ratio)
    share = 1.0 - richer.held_nm**2 / max(fit.held_nm**2, 1e-300)
    if share < MIN_POWER_SHARE or sure < DEPENDENCE_SIGMAS:
        return None
    if term.of_each_run and not _in_most_runs(fit, richer, share):
        return None
    size = float(np.sqrt(share)) * fit.held_nm
    if size < MIN_OVER_NOISE * regression.made_by_noise_nm(fit.values, term.columns):
        return None
    at, shape_nm = tuple(term.at.tolist()), tuple((term.shape @ gains).tolist())
    found = Dependence(
        term.on, size, size / regression.torque_nm, float(norm.sf(sure)), at, shape_nm, term.wave_on, term.wave_hz,
        term.changes,
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

    The stiffness is that at the start angle: what the term adds to the slope there is part of it.
    """
    if term.on == "torque":
        return regression.moved_by(fit, term.columns @ gains)
    moved = {n: v - fit.values[n] for n, v in richer.values.items() if n in fit.values}
    if term.on == "angle" and term.at.size and ("stiffness",) in moved:
        slope = np.gradient(term.shape @ gains, term.at)
        start = float(np.clip(0.0, term.at[0], term.at[-1]))
        moved[("stiffness",)] += float(np.interp(start, term.at, slope))
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


def free_forms(regression: TorqueRegression) -> list[FreeForm]:
    """The terms that are tried, without what the linear model has of the same quantity."""
    _, rate, _, torque, time, run = regression.series()
    slow = 0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300
    driven = [] if regression.torque_free else [_spline("torque", regression)]
    ends = np.array([-1.0, 1.0])
    out = [
        _spline("angle", regression), _beyond("angle", regression), _spline("rate", regression), *driven,
        FreeForm(
            "direction", regression.along("rate", lambda v: np.tanh(v / slow)[:, None]), ends, ends[:, None]
        ),
    ]  # fmt: skip
    if float(np.max(time)) > 0.0:
        angle = regression.series()[0]
        out += [_over_time(time), *_changing(time, {"stiffness": angle, "damping": rate})]
        out += [] if regression.torque_free else _changing(time, {"torque of the drive": torque})
    out.append(_history(rate, run, regression))
    return [f for f in out if f.columns.shape[1] > 0 and np.all(np.isfinite(f.columns))]


def _spline(on: str, regression: TorqueRegression) -> FreeForm:
    """Cubic splines of a quantity with what is constant and linear in it taken out."""
    x = regression.values_of(on)
    free, at = _free_splines(x)
    if free is None:
        return FreeForm(on, np.zeros((len(regression.series()[0]), 0)), np.zeros(0), np.zeros((0, 0)))
    return FreeForm(on, regression.along(on, free), at, free(at))


def _over_time(time: Array) -> FreeForm:
    """The same of the time in a run."""
    free, at = _free_splines(time)
    return FreeForm("time", np.zeros((len(time), 0)) if free is None else free(time), at, free(at) if free else at)


def _free_splines(x: Array) -> tuple[Callable[[Array], Array] | None, Array]:
    """Splines with knots at even shares of the values, and places at which to show them; None of too few values."""
    inner = np.unique(np.quantile(x, np.linspace(0.0, 1.0, SPLINE_KNOTS + 2)))
    if len(inner) < 4:
        return None, np.zeros(0)
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])

    def basis(values: Array) -> Array:
        return np.asarray(BSpline.design_matrix(np.clip(values, inner[0], inner[-1]), knots, 3).toarray())

    def straight(values: Array) -> Array:
        return np.column_stack([np.ones(len(values)), values])

    columns = basis(x)
    line = np.linalg.lstsq(straight(x), columns, rcond=None)[0]
    _, s, v = np.linalg.svd(columns - straight(x) @ line, full_matrices=False)
    kept = v[s > 1e-6 * s[0]].T
    at = np.linspace(inner[0], inner[-1], SHAPE_POINTS)
    return lambda values: (basis(values) - straight(values) @ line) @ kept, at


def _beyond(on: str, regression: TorqueRegression) -> FreeForm:
    """What begins at the ends of a quantity's range, as a stop does: straight from the outer shares of samples on."""
    x = regression.values_of(on)
    middle = float(np.median(x))
    starts = [(s, float(np.quantile(s * (x - middle), share))) for s in (-1.0, 1.0) for share in OUTER]

    def hinges(values: Array) -> Array:
        return np.stack([s * np.maximum(s * (values - middle) - b, 0.0) for s, b in starts], axis=1)

    at = np.linspace(float(np.min(x)), float(np.max(x)), SHAPE_POINTS)
    return FreeForm(on, regression.along(on, hinges), at, hinges(at))


def _changing(time: Array, series: Mapping[str, Array]) -> list[FreeForm]:
    """What angle, rate and torque pass on, changing with time: a spring that sets, grease or a drive that warms up."""
    along = (time - np.mean(time)) / max(float(np.ptp(time)), 1e-300)
    shape = np.stack([along, along**2 - np.mean(along**2)], axis=1)
    none = np.zeros((0, 2))
    return [FreeForm("time", shape * x[:, None], np.zeros(0), none, changes=what) for what, x in series.items()]


def _along_angle(regression: TorqueRegression) -> list[FreeForm]:
    """Inertia, damping and dry friction that change with the angle: a crank, an eccentric magnet, a seal.

    A turning inertia that changes with the angle gives the square of the rate besides, by half its slope (Lagrange).
    Each changes about what it is on average where it shows, which is the number that the model has.
    """
    angle, rate, acceleration = regression.series()[:3]
    free, _ = _free_splines(angle)
    if free is None:
        return []

    def shape(at: Array) -> Array:
        return np.column_stack([at, free(at)])

    beside = 1e-4 * float(np.ptp(angle))
    slope = (shape(angle + beside) - shape(angle - beside)) / (2.0 * beside)
    here = shape(angle)

    def about(x: Array) -> Array:
        return here - (x**2 @ here) / max(float(x @ x), 1e-300)

    slow = 0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300
    direction = np.tanh(rate / slow)
    terms = {
        "inertia": about(acceleration) * acceleration[:, None] + 0.5 * slope * rate[:, None] ** 2,
        "damping": about(rate) * rate[:, None],
        "friction": about(direction) * direction[:, None],
    }
    none = np.zeros((0, here.shape[1]))
    return [FreeForm("angle", columns, np.zeros(0), none, changes=what) for what, columns in terms.items()]


def _pulsating(regression: TorqueRegression, fit: TorqueFit) -> list[FreeForm]:
    """Angle, rate and torque times a wave over the time: a spring, a damping or a gain that something outside changes.

    The frequency is where the residual times the quantity has its highest line; the phase is another in every run.
    """
    angle, rate, _, torque, time, run = regression.series()
    residual = np.concatenate(fit.residuals)
    out = []
    driven = [] if regression.torque_free else [("torque", torque)]
    for on, series in (("angle", angle), ("rate", rate), *driven):
        frequency_hz = _strongest_line_hz(residual * series, time, run, regression.cutoff_hz)
        if frequency_hz is None:
            continue
        wave = np.exp(2j * np.pi * frequency_hz * time) * series
        columns = [part * (run == k) for k in np.unique(run) for part in (wave.real, wave.imag)]
        none = np.zeros((0, len(columns)))
        out.append(FreeForm("time", np.stack(columns, axis=1), np.zeros(0), none, True, on, frequency_hz))
    return out


def _strongest_line_hz(values: Array, time: Array, run: Array, highest_hz: float) -> float | None:
    """The frequency at which the power of all runs' lines is highest; None where no run is long enough for one."""
    step_s = float(np.min(np.diff(time)[np.diff(time) > 0.0], initial=np.inf))
    longest_s = float(np.max(time))
    lowest_hz = MIN_PERIODS / max(longest_s, 1e-300)
    if not np.isfinite(step_s) or lowest_hz >= min(highest_hz, 0.5 / step_s):
        return None
    size = 2 ** int(np.ceil(np.log2(2.0 * longest_s / step_s + 2.0)))  # half a line's width between two frequencies
    power = np.zeros(size // 2 + 1)
    for k in np.unique(run):
        here = run == k
        on_grid = np.bincount(np.rint(time[here] / step_s).astype(int), values[here] - np.mean(values[here]), size)
        power += np.abs(np.fft.rfft(on_grid)) ** 2
    hz = np.fft.rfftfreq(size, step_s)
    power[(hz < lowest_hz) | (hz > highest_hz)] = 0.0
    return float(hz[np.argmax(power)])


def _history(rate: Array, run: Array, regression: TorqueRegression) -> FreeForm:
    """The direction of the motion as it was a while ago, with two lengths of memory."""
    direction = np.tanh(rate / (0.05 * float(np.sqrt(np.mean(rate**2))) + 1e-300))
    out = np.zeros((len(rate), len(PAST_RUN_SHARES)))
    for k in np.unique(run):
        here = np.nonzero(run == k)[0]
        for j, share in enumerate(PAST_RUN_SHARES):
            memory, decay = 0.0, float(np.exp(-1.0 / max(share * 0.1 * len(here), 1.0)))
            for i in here:
                memory = decay * memory + (1.0 - decay) * direction[i]
                out[i, j] = memory
    return FreeForm("history", out, np.zeros(0), np.zeros((0, len(PAST_RUN_SHARES))))
