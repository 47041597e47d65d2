"""What a proof found, as plain values: errors against the linear model with and without compensation, the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from rig.arrays import Array

ProofStatus = Literal["confirmed", "partly", "refuted", "cannot be told"]


@dataclass(frozen=True)
class Share:
    """A share of an error that is left (0: all of it went away), with its 95 % interval."""

    left: float
    ci95: tuple[float, float]

    @property
    def gone(self) -> float:
        """The share that went away; negative where the error grew."""
        return 1.0 - self.left

    @property
    def gone_ci95(self) -> tuple[float, float]:
        """Its interval."""
        return 1.0 - self.ci95[1], 1.0 - self.ci95[0]


@dataclass(frozen=True)
class ProofSet:
    """One set, with a compensation and with less or none.

    Parameters
    ----------
    without, compensated
        Names of the two runs.
    error_without, error_compensated
        Root mean square of measured less linear model, in the unit of the measured channel.
    noise
        Standard deviation of the sensor's noise, which both errors contain.
    share
        Of the error, noise apart; None where there was none beyond the noise to begin with.
    announced_left, announced_error
        The share that the model itself said would be left, and the error without compensation, before anything was
        played.
    """

    set: str
    without: str
    compensated: str
    error_without: float
    error_compensated: float
    noise: float
    share: Share | None
    announced_left: float
    announced_error: float


@dataclass(frozen=True)
class EffectProof:
    """What became of one name, or of all together, over all sets."""

    status: ProofStatus
    why: str  # one sentence
    share: Share | None
    announced_left: float
    sets: tuple[ProofSet, ...]
    stays: str = ""  # what of it no compensation takes away, said before anything was played


@dataclass(frozen=True)
class ProofLines:
    """What the report draws of one set: measured less linear model, without and with compensation, (n,) each."""

    set: str
    time_s: Array
    without: Array
    compensated: Array


@dataclass(frozen=True)
class LateTicks:
    """Ticks of the compensated runs whose torque came late, and what they may have done.

    Parameters
    ----------
    late, ticks
        Deadlines at which the torque of an earlier tick still stood, by the recorded torque, of how many.
    reproduced
        The share of the error that remained which the identified model reproduces when it is given the torque as it was
        played; None where no more than noise remained.
    """

    late: int
    ticks: int
    reproduced: float | None


@dataclass(frozen=True)
class Proof:
    """A proof that was played.

    Parameters
    ----------
    total
        All effects compensated, against none.
    effects
        Each name for itself: all compensated, against all but this one.
    rivals
        Rivals that were played in the place of a name, under "effect / rival".
    not_cancelled
        Effects that no torque cancels, and why.
    torque_scale
        By how much the sets were reduced so that they stay within the limits with compensation, by name of the set.
    excluded
        Names that were refuted and left out of the search that followed.
    late
        The late ticks of the compensated runs; None where there were none.
    """

    total: EffectProof
    effects: Mapping[str, EffectProof]
    rivals: Mapping[str, EffectProof] = field(default_factory=dict)
    not_cancelled: Mapping[str, str] = field(default_factory=dict)
    torque_scale: Mapping[str, float] = field(default_factory=dict)
    lines: tuple[ProofLines, ...] = ()
    excluded: tuple[str, ...] = ()
    late: LateTicks | None = None
    earlier: tuple[str, ...] = ()  # what earlier proofs of this campaign found, one sentence each
