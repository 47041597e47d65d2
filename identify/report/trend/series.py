"""Campaigns of one rig as series: one quantity over the campaigns that determine it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np

from identify.report.trend.change_points import Level, levels
from identify.wording import SYMBOLS, plain, title
from rig.arrays import Array

DISTURBANCE = "disturbance"
PARAMETERS = ("inertia", "damping", "stiffness", "damping_over_inertia", "stiffness_over_inertia")
TORQUES = ("N*m", "N")


@dataclass(frozen=True)
class Estimate:
    """A value of one campaign with its 95 % interval; bounds and standard error are None where there is no interval."""

    value: float
    unit: str
    std_error: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Campaign:
    """What one campaign adds to the trends of its rig.

    ``values`` are J, C and K by name, parameters of effects as "coulomb_friction.level", and the disturbance.
    ``played_at`` carries its time zone; None where nobody knows it.
    """

    name: str
    path: str
    axis: str
    accepted: bool
    effects: tuple[str, ...]
    played_at: datetime | None = None
    values: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True)
class Series:
    """One quantity over the campaigns that determine it; ``at`` counts them among all of the rig."""

    quantity: str
    unit: str
    at: tuple[int, ...]
    estimates: tuple[Estimate, ...]
    levels: tuple[Level, ...]

    @property
    def values(self) -> Array:
        """Shape (n,), in ``unit``."""
        return np.array([e.value for e in self.estimates])


def in_order(campaigns: Sequence[Campaign]) -> tuple[Campaign, ...]:
    """By date if all have one, else by path."""
    if has_dates(campaigns):
        return tuple(sorted(campaigns, key=lambda c: (c.played_at or datetime.min.replace(tzinfo=UTC), c.path)))
    return tuple(sorted(campaigns, key=lambda c: c.path))


def has_dates(campaigns: Sequence[Campaign]) -> bool:
    """Whether it is known of each when it was played."""
    return all(c.played_at is not None for c in campaigns)


def series_of(campaigns: Sequence[Campaign]) -> tuple[Series, ...]:
    """The series of ordered campaigns of one rig: J, C, K, levels of friction, disturbance."""
    named = dict.fromkeys(name for c in campaigns for name in c.values)
    friction = sorted(name for name in named if _is_friction_level(name, campaigns))
    out = []
    for quantity in (*PARAMETERS, *friction, DISTURBANCE):
        held = [(i, c.values[quantity]) for i, c in enumerate(campaigns) if quantity in c.values]
        if not held:
            continue
        estimates = tuple(e for _, e in held)
        errors = np.array([e.std_error if e.std_error and math.isfinite(e.std_error) else 0.0 for e in estimates])
        found = levels(np.array([e.value for e in estimates]), errors)
        out.append(Series(quantity, estimates[0].unit, tuple(i for i, _ in held), estimates, found))
    return tuple(out)


def _is_friction_level(name: str, campaigns: Sequence[Campaign]) -> bool:
    effect, _, parameter = name.partition(".")
    units = {c.values[name].unit for c in campaigns if name in c.values}
    return bool(parameter) and effect.endswith("friction") and units <= set(TORQUES)


def heading(quantity: str, axis: str) -> str:
    """ "rotary inertia J", "Coulomb friction, level", "disturbance (rms)"."""
    if quantity == DISTURBANCE:
        return "disturbance (rms)"
    effect, _, parameter = quantity.partition(".")
    if parameter:
        return f"{plain(effect)}, {parameter.replace('_', ' ')}"
    return title(quantity, axis) if quantity in SYMBOLS else plain(quantity)
