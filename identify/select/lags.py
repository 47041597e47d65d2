"""Lags and delays, wherever between torque and reading: what is the same in torque, and what no platform does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from identify.bounds.cramer_rao import DELAY
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.diagnose.torque_residual import lags_of
from identify.likelihood.fit import Fit
from identify.model.parameters import Name
from identify.model.structure import Structure
from rig import effects
from rig.effects.base import Place

SAME_DELAY = 0.1  # relative difference of a lag of the gyro and a delay of the drive that are one in torque
PASSIVE_SIGMAS = 3.0  # standard errors below zero, from which a damping is no chance
INERTIA: Name = ("inertia",)
DAMPING: Name = ("damping",)


class KnownDelays:
    """Delays of the drive that were weighed: how much later beside which effects, and their weight."""

    def __init__(self) -> None:
        self._known: dict[frozenset[str], list[tuple[float, float]]] = {}

    def add(self, effect: str, now: Fit, new: Fit, weight: float) -> None:
        """Remember a delay of the drive, beside a model without it."""
        self._known.setdefault(_beside(effect, new), []).append((_later_by(now, new), weight))

    def weight_of(self, effect: str, now: Fit, new: Fit) -> float:
        """Weight of a delay of the drive that makes a model as late as a lag of the gyro does, beside the same effects;
        zero if none was tried.

        What the residual in torque shows of the two is the same, and the weight is to say whether something is late.
        Which of the two it is, the likelihood says. A lag that was there may have become another one beside it: so all
        that is late counts, and how long one of them is does not.
        """
        late_s, known = _later_by(now, new), self._known.get(_beside(effect, new), [])
        return max((weight for long, weight in known if abs(long - late_s) <= SAME_DELAY * late_s), default=0.0)


def takes_damping(effect: str, now: Fit, new: Fit) -> bool:
    """Whether a lag leaves the platform with a damping below zero, which no platform has.

    Below resonance a lag turns the phase as damping does, and what a model leaves may ask for any of the two.
    """
    return _late_by(effect, new) > 0.0 and drives(new) and not drives(now)


def drives(fit: Fit) -> bool:
    """Whether a model's damping is below zero by more than chance: it would feed the motion."""
    if DAMPING not in fit.names:
        return False
    return bool(fit.values[DAMPING] < -PASSIVE_SIGMAS * fit.std_error(DAMPING))


def exchanged(fit: Fit) -> dict[Name, float] | None:
    """The numbers of a model whose lag and platform have changed places; None where they cannot.

    Without a spring a platform is a low-pass of first order, and so is a lag: of two in a row, no torque and rate tell
    which has the time J / C and which the lag's.
    """
    lags = [e for e in fit.structure.effects if effects.get(e).is_first_order_lag]
    if "stiffness" in fit.structure.terms or len(lags) != 1:
        return None
    time: Name = (lags[0], effects.get(lags[0]).parameters[0].name)
    inertia, damping, late_s = (fit.values.get(n, 0.0) for n in (INERTIA, DAMPING, time))
    if min(inertia, damping, late_s) <= 0.0:
        return None
    return {**fit.values, INERTIA: damping * late_s, time: inertia / damping}


def _late_by(effect: str, fit: Fit) -> float:
    """By how much later slow motion is read because of an effect."""
    return effects.get(effect).late_s(fit.structure.shapes_of(fit.values)[effect])


def _later_by(now: Fit, new: Fit) -> float:
    """By how much later slow motion is read in one model than in another, whatever makes it so."""
    late_s = [sum(_late_by(e, fit) for e in fit.structure.effects) for fit in (new, now)]
    return late_s[0] - late_s[1]


def _beside(effect: str, fit: Fit) -> frozenset[str]:
    """The effects of a model but for one."""
    return frozenset(fit.structure.effects) - {effect}


@dataclass(frozen=True)
class SensorPart:
    """Effects in the sensor that the likeliest model has besides the declared ones, kept beside a search in torque.

    No torque shows them, but a gyro's low-pass is in the motion that it shows: there the torque is taken behind it,
    as long as the likelihood has it.

    Attributes
    ----------
    names, values
        The effects, and their parameters and that of a declared delay of the drive as the likelihood has them.
    declared
        The declared model.
    """

    names: tuple[str, ...]
    values: Mapping[Name, float]
    declared: Structure

    @classmethod
    def of(cls, likeliest: Fit, declared: Structure) -> SensorPart:
        """Of the likeliest model."""
        names = tuple(
            e for e in likeliest.structure.effects
            if e not in declared.effects and effects.get(e).place is Place.SENSOR
        )  # fmt: skip
        values = {k: v for k, v in likeliest.values.items() if k[0] in names or (names and k[0] == DELAY)}
        return cls(names, values, declared)

    def begun(self, regression: TorqueRegression, shapes: Mapping[str, tuple[float, ...]]) -> TorqueFit:
        """The declared model in torque, behind the low-passes of a gyro."""
        lags = tuple(lags_of(self.names)) if regression.by_gyro else ()
        return regression.solve(self.declared.plus(*lags), {**shapes, **Structure(effects=lags).shapes_of(self.values)})

    def put_back(self, fit: TorqueFit) -> tuple[Structure, dict[Name, float]]:
        """A model found in torque with the sensor's part, and its values."""
        structure = fit.structure.plus(*(n for n in self.names if n not in fit.structure.effects))
        return structure, {**fit.values, **{k: v for k, v in self.values.items() if k[0] in structure.effects}}
