"""A model fitted to recordings, whatever fitted it: parameters, their covariance, what is left, how likely it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identify.model.parameters import Name, platform_of
from identify.model.structure import Structure
from rig.arrays import Array
from rig.platform import Platform

# Smallest over largest eigenvalue of the scaled information that still determines a direction: rounding of normal
# equations made of some 1e5 samples. By derivation; set by hand within a factor of ten.
MIN_EIGENVALUE_RATIO = 1e-12
ZERO_INFORMATION = 1e-290  # what a parameter without any influence leaves of rounding, at the end of float64


@dataclass(frozen=True)
class ParameterFit:
    """What every kind of fit holds.

    Attributes
    ----------
    names, vector
        Parameters in a fixed order and their values, (p,).
    count
        Samples that were fitted.
    variance
        Mean square of the residual, in units of what was fitted.
    cost
        Minus twice the logarithm of the likelihood, up to a constant of the samples. Fits of one kind to the same
        samples compare by it.
    information
        Normal matrix of the parameters for a residual of unit variance, what belongs to single runs eliminated, (p, p).
    """

    structure: Structure
    names: tuple[Name, ...]
    vector: Array
    count: int
    variance: float
    cost: float
    information: Array

    @cached_property
    def values(self) -> Mapping[Name, float]:
        """Parameters by name."""
        return dict(zip(self.names, self.vector.tolist(), strict=True))

    @property
    def sigma(self) -> float:
        """Root mean square residual, in units of what was fitted."""
        return float(np.sqrt(self.variance))

    @property
    def held_out_error(self) -> float:
        """Root mean square residual on samples held out; on those fitted where none were."""
        return self.sigma

    @property
    def penalised(self) -> float:
        """The cost with every parameter paid for (Schwarz 1978)."""
        return self.cost + len(self.vector) * float(np.log(max(self.count, 2)))

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the parameters for a white residual, (p, p); directions that the data leave open are left out.

        Infinite where the fit ran away.
        """
        scale = np.sqrt(np.maximum(np.diag(self.information), 1e-300))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            scaled = self.information / np.outer(scale, scale)
            if not np.all(np.isfinite(scaled)):
                return np.full_like(scaled, np.inf)
            inverse = np.linalg.pinv(scaled, rcond=MIN_EIGENVALUE_RATIO, hermitian=True)
            return np.asarray(inverse / np.outer(scale, scale) * self.variance)

    def std_error(self, name: Name) -> float:
        """One standard error of a parameter."""
        return std_error_of(name, self.names, self.covariance)

    def std_errors(self) -> dict[Name, float]:
        """Standard error of every parameter; infinite where the fit ran away or the data hold nothing of it."""
        size = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        size[~(np.diag(self.information) > ZERO_INFORMATION)] = np.inf  # a limit that nothing reaches
        return dict(zip(self.names, size.tolist(), strict=True))

    def platform(self, run: int = 0, added: float = 0.0) -> Platform:
        """The fitted platform, as it stood in one run."""
        return platform_of(self.structure, self.names, self.vector, run, added)


def std_error_of(name: Name, names: Sequence[Name], covariance: Array) -> float:
    """One standard error of a parameter, of a covariance in the order of ``names``."""
    i = names.index(name)
    return float(np.sqrt(max(covariance[i, i], 0.0)))


def sizes(squares: Array) -> Array:
    """Square roots, by which parameters are scaled; infinite where a square is zero.

    What the data know nothing of is moved by nothing then: by a tiny size rounding would be carried to 1e132.
    """
    return np.where(squares > 0.0, np.sqrt(np.maximum(squares, 1e-300)), np.inf)


def reduced_chi_square(error: float, noise: float) -> float:
    """Mean square of an error over that of the noise: one where nothing but the noise is left.

    The one scale on which "at the noise" is decided. Both are root mean squares in the same unit.
    """
    return (error / noise) ** 2 if noise > 0.0 else np.inf
