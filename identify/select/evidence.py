"""What speaks for one model against another: how much likelier it is, and how much of what is left it carries.

The likelihood takes the torque disturbance for a sum of a white and a slow part. A real one is coloured otherwise,
repeats with the motion, differs between runs; a fall of the cost then means less than it says. How much less shows in
the scores of the parameters in question: over blocks of the record they scatter by more than the likelihood takes them
to. The fall of the cost is divided by that ratio (the scaled likelihood ratio of Satorra and Bentler 1994; the
sandwich of White 1982), which is one where the likelihood is right.

On a real record everything is significant, so a name takes weight, too: a share of the disturbance that goes with it,
on samples not fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.stats import chi2

from identify.bounds.separation import EVIDENCE_BLOCKS
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.diagnose.torque_residual import lags_of
from identify.estimate.covariance import orthogonal_part
from identify.likelihood.fit import Columns, Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.select.lags import KnownDelays, takes_damping
from rig import effects
from rig.arrays import Array
from rig.dynamics.gains import Noise
from rig.effects.base import Place
from rig.platform import TERMS

CHANCE = 0.95  # quantile of a ratio of variances: what chance alone reaches is no sign of a wrong likelihood
MIN_RUNS = 4  # whose scores show whether runs differ
MIN_OWN_INFLUENCE_SHARE = 1e-3  # of a parameter's influence, that the others leave: of less only rounding is seen
ADDED_SUPPORT = 20.0  # support of an effect that is added: no chance among all candidates and their shapes makes it
STRONG_SUPPORT = 10.0  # support that parts two models (Kass and Raftery 1995: very strong)
WEIGHT = 0.20  # share of the disturbance that an effect takes away to be named: below, it is true but small
PREDICTS_TO_NOISE = 1.1  # reduced chi-square: a model that predicts as closely leaves no disturbance to follow
MAX_EFFECTS = 6  # that one recording is believed to show
MAX_UNFOLLOWED_SHARE = 0.5  # of what a prediction errs by beyond the sensor's noise
MAX_TRUSTED_INFLATION = 1.5  # inflation up to which what the likelihood takes the disturbance for is believed
SHOWS = 0.1  # of the disturbance in the band, that its white part is: what becomes of less is chance


@dataclass(frozen=True)
class Evidence:
    """One model against another that has less.

    Attributes
    ----------
    gain
        Fall of the cost, minus twice the logarithm of the likelihood.
    inflation
        Variance of the scores over what the likelihood takes it for, one at least.
    price
        Penalty for the parameters that were added (Schwarz 1978).
    weight
        Share of the disturbance's power that goes with the model; one for an effect in the sensor that no residual in
        torque shows, since the motion there is another sensor's.
    unfollowed_share
        Share that goes of what predictions err by beyond the sensor's noise.
    """

    effect: str
    fit: Fit
    gain: float
    inflation: float
    price: float
    weight: float
    unfollowed_share: float = 0.0

    @property
    def support(self) -> float:
        """Fall of the cost as far as it can be believed, parameters paid for."""
        return self.gain / self.inflation - self.price


class EvidenceModel:
    """Weighs models of one recording against each other.

    Parameters
    ----------
    problem
        The runs that are searched, and their likelihood.
    regression
        The same in torque.
    floor_nm
        What the sensor's noise alone leaves there, root mean square.
    """

    def __init__(self, problem: PredictionError, regression: TorqueRegression, floor_nm: float) -> None:
        self.problem, self.regression, self.floor_nm = problem, regression, floor_nm
        self._delays = KnownDelays()

    def evidence(self, effect: str, now: Fit, new: Fit, benefit_of_doubt: bool = False) -> Evidence:
        """A model with more against the one without it; ``effect`` is the effect or term that is judged.

        With the ``benefit_of_doubt`` the likelihood's own share counts for its weight though it cannot be trusted.
        """
        added = [n for n in new.names if n not in now.names]
        inflated = inflation(self.problem.columns_at(new, with_variance=True), new, added)
        torqueless = effect not in TERMS and effects.get(effect).place is Place.SENSOR
        if torqueless and (self.problem.both or not self.regression.by_gyro):
            weight = 1.0  # two sensors of one motion show by themselves which is late
        else:
            weight = self.explained_share(now, new, benefit_of_doubt or is_trusted(inflated), torqueless)
            weight = max(weight, self._delays.weight_of(effect, now, new)) if torqueless else weight
        if effect not in TERMS and takes_damping(effect, now, new):
            weight = 0.0
        price = (new.penalised - new.cost) - (now.penalised - now.cost)
        return Evidence(effect, new, now.cost - new.cost, inflated, price, weight, unfollowed_share(now, new))

    def all(self, now: Fit, fits: Mapping[str, Fit]) -> dict[str, Evidence]:
        """Several models, each with one effect more, against the one without it."""
        found = self.problem.workers.each(lambda n: self.evidence(n, now, fits[n]), list(fits))
        out = {e.effect: replace(e, fit=fits[e.effect]) for e in found}
        for name, e in out.items():
            if name not in TERMS and effects.get(name).delay_s is not None:
                self._delays.add(name, now, e.fit, e.weight)
        if self.problem.both or not self.regression.by_gyro:
            return out
        lags = [n for n in out if n not in TERMS and effects.get(n).lag is not None]
        return out | {
            n: replace(out[n], weight=max(out[n].weight, self._delays.weight_of(n, now, out[n].fit))) for n in lags
        }

    def explained_share(self, now: Fit, new: Fit, trusted: bool, torqueless: bool = False) -> float:
        """Share of the disturbance that goes: of its power in the band of the motion, or of its white part.

        The power in the band is what the residual in torque has on held-out samples, and what the likelihood takes the
        disturbance for. The first knows no model of it but sees the sensor's noise as well, the second the reverse, so
        the second counts only where the likelihood can be ``trusted``. Most of what predictions err by beyond the
        sensor's noise counts in any case: a dead zone acts at every crossing of zero, far above the band of the motion.

        An effect in the sensor is no torque (``torqueless``), but it makes the motion late: only in the residual in
        torque, the torque taken as late, is it seen as such. To the likelihood it may be a filter that takes any torque
        for noise ahead of it.
        """
        shares = [1.0 - self.left(self.in_torque(new)) / self.left(self.in_torque(now))]
        if torqueless:
            return float(shares[0])
        if trusted:
            shares.append(likely_share(now, new, self.regression.cutoff_hz))
            cutoff_hz = self.regression.cutoff_hz
            if now.noise.white * cutoff_hz > SHOWS * in_band(now.noise, cutoff_hz):
                shares.append(1.0 - new.noise.white * new.variance / (now.noise.white * now.variance))
        if (share := unfollowed_share(now, new)) > MAX_UNFOLLOWED_SHARE:
            shares.append(share)
        return float(max(shares))

    def left(self, fit: TorqueFit) -> float:
        """Power of the held-out residual in torque, the sensor's part taken off."""
        return fit.power_above(self.floor_nm)

    def is_the_sensors(self, fit: Fit) -> bool:
        """Whether a model leaves less of a disturbance in the band, by the likelihood, than the sensor makes there."""
        return in_band(fit.noise, self.regression.cutoff_hz) * fit.variance <= self.floor_nm**2

    def in_torque(self, fit: Fit) -> TorqueFit:
        """A model along the measured motion, its gains fitted there."""
        return torque_fit_of(self.regression, fit)


def is_trusted(inflation: float) -> bool:
    """Whether what the likelihood takes the disturbance for is believed."""
    return inflation < MAX_TRUSTED_INFLATION


def in_band(noise: Noise, cutoff_hz: float) -> float:
    """Variance of a disturbance below a frequency, over the variance of one reading."""
    w = 2.0 * np.pi * cutoff_hz * noise.time_constant_s
    slow, smooth = np.arctan(w), np.arctan(w) + w / (1.0 + w**2)  # integrals of 1 / (1 + w^2)^n, n of one and two
    return float((noise.slow * slow + noise.smooth * smooth) * 2.0 / np.pi + noise.white * cutoff_hz)


def likely_share(now: Fit, new: Fit, cutoff_hz: float) -> float:
    """Share of what the likelihood takes the disturbance below a frequency for, that goes with a model."""
    before, after = (in_band(f.noise, cutoff_hz) * f.variance for f in (now, new))
    return 1.0 - after / max(before, 1e-300)


def torque_fit_of(regression: TorqueRegression, fit: Fit) -> TorqueFit:
    """A model along the measured motion, in torque: of what is in the sensor, a gyro's low-passes."""
    shapes = fit.structure.shapes_of(fit.values)
    there = {place: [e for e in fit.structure.effects if effects.get(e).place is place] for place in Place}
    lags = lags_of(there[Place.SENSOR]) if regression.by_gyro else []
    seen = tuple(e for e in fit.structure.effects if effects.get(e).place is not Place.SENSOR or e in lags)
    shaft = (*there[Place.LOAD], *there[Place.FRICTION])
    for kept in (seen, shaft, ()):
        # A drive that passes on nothing explains any torque, and a play run along a noisy motion may run away.
        found = regression.solve(replace(fit.structure, effects=kept), shapes)
        if found.held_nm < regression.torque_nm:
            break
    return found


def unfollowed_share(now: Fit, new: Fit) -> float:
    """Share that goes of what predictions err by beyond the sensor's noise."""
    return 1.0 - (new.reduced_chi_square - 1.0) / max(now.reduced_chi_square - 1.0, 1e-300)


def inflation(parts: Sequence[Columns], fit: Fit, names: Sequence[Name]) -> float:
    """Variance of the scores of some parameters over what the likelihood takes it for, one at least.

    The other parameters and the runs' own unknowns are projected out. Blocks of the record show what is coloured or
    comes in bursts; whole runs, where there are several, show what differs between them.
    """
    columns = [orthogonal_part(p.own, p.columns) for p in parts]
    scaled = [orthogonal_part(p.own, p.scaled[:, None])[:, 0] for p in parts]
    information = np.sum([x.T @ x for x in columns], axis=0)
    mine = [fit.names.index(n) for n in names if information[(i := fit.names.index(n)), i] > 0.0]
    others = [i for i in range(len(fit.names)) if i not in mine and information[i, i] > 0.0]
    if not mine or not np.all(np.isfinite(information)):
        return 1.0
    across = information[np.ix_(others, mine)]
    taken = np.linalg.pinv(information[np.ix_(others, others)], rcond=1e-12, hermitian=True) @ across
    own = [x[:, mine] - x[:, others] @ taken for x in columns]
    size = np.sqrt(np.sum([np.sum(x * x, axis=0) for x in own], axis=0))
    known = size > MIN_OWN_INFLUENCE_SHARE * np.sqrt(np.diag(information)[mine])
    own = [x[:, known] / size[known] for x in own]
    expected = np.linalg.pinv(
        np.sum([x.T @ x for x in own], axis=0) * fit.variance, rcond=MIN_OWN_INFLUENCE_SHARE, hermitian=True
    )

    def ratio(scores: Sequence[Array]) -> float:
        s = np.array(scores)
        s = (s - s.mean(axis=0)) * np.sqrt(len(s) / (len(s) - 1.0))  # a fit that has not quite arrived has a mean
        return float(np.trace(expected @ (s.T @ s))) / max(int(np.sum(known)), 1) / _by_chance(len(s) - 1)

    each = max(1, round(EVIDENCE_BLOCKS / len(parts)))
    blocks = [
        x[rows].T @ z[rows]
        for x, z in zip(own, scaled, strict=True) for rows in np.array_split(np.arange(len(z)), each)
    ]  # fmt: skip
    found = [1.0, ratio(blocks)]
    if len(parts) >= MIN_RUNS:
        found.append(ratio([x.T @ z for x, z in zip(own, scaled, strict=True)]))
    return max(x for x in found if np.isfinite(x))


@lru_cache(maxsize=32)
def _by_chance(count: int) -> float:
    """What a mean of so many squared unit normals reaches by chance."""
    return float(chi2.ppf(CHANCE, count)) / count
