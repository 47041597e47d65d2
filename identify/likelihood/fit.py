"""A model fitted to recordings: its parameters, its noise, its likelihood, and what it is computed from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.model.parameter_fit import MIN_EIGENVALUE_RATIO, ParameterFit, sizes
from identify.model.parameters import Name, is_gain
from identify.model.structure import Structure
from identify.simulate.shots import Shots
from rig import effects
from rig.arrays import Array
from rig.dynamics.gains import Gains, Noise

MAX_LINEAR_INERTIA_CHANGE = 0.5  # of the inertia: farther than that no first order tells how the gains follow


@dataclass(frozen=True)
class Look:
    """One run's innovations at a parameter vector, m readings a sample."""

    innovations: Array  # (n, m)
    variance: Array  # (n, m)
    state: Array  # angle, rate, slow torque after each sample, (n, 3)
    gains: Gains
    floor: float  # the variance of one reading is no less


@dataclass(frozen=True)
class Columns:
    """One run's derivatives at a fit, of the samples that count, readings of a sample one after the other.

    Attributes
    ----------
    columns
        What the parameters do to the scaled innovations, (n, p).
    own
        What the run's own unknowns do, (n, k): a gyro's bias, and start states where they are fitted.
    scaled
        Innovations over their standard deviation, (n,).
    variance
        Of the innovations, (n,).
    """

    columns: Array
    own: Array
    scaled: Array
    variance: Array


@dataclass(frozen=True)
class Prediction:
    """Every reading predicted one sample ahead, one array a run.

    Attributes
    ----------
    innovations
        Measured minus predicted, in units of the reading, (n, m) each of m readings.
    variance
        Of the innovations, over the variance of one reading's noise, (n, m) each.
    costs
        What each sample adds to minus twice the log-likelihood, all its readings together, (n,) each.
    disturbance_nm
        The torque nobody recorded, as the innovations show it: its slow part and, sample by sample, the torque that
        the correction of the rate stands for, (n,) each.
    """

    innovations: list[Array]
    variance: list[Array]
    costs: list[Array]
    disturbance_nm: list[Array]


@dataclass(frozen=True)
class Fit(ParameterFit):
    """A model fitted by prediction error.

    Attributes
    ----------
    variance
        Of one reading's noise, as the innovations show it.
    noise
        Torque disturbance in relation to the sensor's noise.
    shots
        The runs with their start states and biases.
    reduced_chi_square
        Variance of the prediction over what it were without a torque disturbance: one at the noise of the sensor.
    arrived
        Whether no step leads down from here; not known of a fit that was only to be compared.
    """

    noise: Noise
    shots: tuple[Shots, ...]
    prediction: Prediction
    reduced_chi_square: float
    arrived: bool = True

    @property
    def penalised(self) -> float:
        """The cost with its parameters paid for (Schwarz 1978), and the noise that only a lag of the gyro has ahead."""
        lags = any(effects.get(e).lag is not None for e in self.structure.effects)
        return super().penalised + lags * float(np.log(max(self.count, 2)))

    def without(self, name: str) -> dict[Name, float]:
        """All other parameters, gains as they follow to first order where those of a term or an effect become zero."""
        gains = [i for i, n in enumerate(self.names) if len(n) == 1 or is_gain(n)]
        gone, rest = ([i for i in gains if (self.names[i][0] == name) is own] for own in (True, False))
        there = {n: float(v) for n, v in zip(self.names, self.vector, strict=True) if n[0] != name}
        size = sizes(np.diag(self.information))
        scaled = self.information / np.outer(size, size)
        gone = [i for i in gone if np.isfinite(size[i])]
        if not (gone and rest and np.all(np.isfinite(scaled))):
            return there
        inverse = np.linalg.pinv(scaled[np.ix_(rest, rest)], rcond=MIN_EIGENVALUE_RATIO, hermitian=True)
        moved = inverse @ scaled[np.ix_(rest, gone)] @ (self.vector[gone] * size[gone]) / size[rest]
        new = {self.names[i]: float(self.vector[i] + d) for i, d in zip(rest, moved, strict=True)}
        inertia = there.get(("inertia",), 0.0)
        far = abs(new.get(("inertia",), inertia) - inertia) > MAX_LINEAR_INERTIA_CHANGE * inertia
        return there if far else there | new


class KnownFits:
    """The best fit of every structure to one set of runs: another model may have led to it from a better place."""

    def __init__(self) -> None:
        self._best: dict[tuple[frozenset[str], frozenset[str]], Fit] = {}

    def of(self, structure: Structure) -> Fit | None:
        """The best fit of a structure; None where it was not fitted."""
        known = self._best.get(structure.parts)
        return known if known is not None and structure.has_the_drive_of(known.structure) else None

    def best(self, fit: Fit) -> Fit:
        """The better one of a fit and of what is known of its structure, which is known from now on."""
        known = self.of(fit.structure)
        if known is None or fit.cost < known.cost:
            self._best[fit.structure.parts] = known = fit
        return known
