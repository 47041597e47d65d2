"""One structure fitted in torque: what it leaves, and what it leaves on samples that it did not see."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from identify.model.parameter_fit import ParameterFit
from rig.arrays import Array


@dataclass(frozen=True)
class TorqueFit(ParameterFit):
    """One structure fitted in torque; its cost counts a coloured residual.

    Attributes
    ----------
    count
        Samples behind the low-pass.
    information
        Of the gains; of shapes, at which the gains are solved for, none.
    held_nm
        Root mean square residual on the samples held out, N m.
    residuals, held
        Of every run, (n,) each: by this fit, and by fits that did not see the samples.
    filters
        Of the autoregression.
    """

    held_nm: float
    residuals: list[Array]
    held: list[Array]
    filters: Array

    @property
    def held_out_error(self) -> float:
        """Root mean square residual on the samples held out, N m."""
        return self.held_nm

    def power_above(self, floor_nm: float) -> float:
        """Mean square of the residual held out, the sensor's part taken off."""
        return max(self.held_nm**2 - floor_nm**2, 1e-4 * floor_nm**2)

    @cached_property
    def shapes(self) -> dict[str, tuple[float, ...]]:
        """Shape parameters of every effect."""
        return self.structure.shapes_of(self.values)


@dataclass(frozen=True)
class TorqueErrors:
    """How far a model is from the torque, behind the low-pass, where the platform moves and does not turn back."""

    residual_nm: float
    relative: float
    held_relative: float  # by fits that did not see the samples
    floor_nm: float
    cutoff_hz: float
