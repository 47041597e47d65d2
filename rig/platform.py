"""The platform as declared or identified: J, C, K and the effects that act besides them (Eq. 1-7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rig.channels import Channel

TERMS = ("inertia", "damping", "stiffness")


@dataclass(frozen=True)
class Platform:
    """J a + C w + K th + effects = M(t).

    Parameters
    ----------
    inertia_kg_m2, damping_nm_s_rad, stiffness_nm_rad
        J, C, K of Eq. 1. A term that is not part of the model is zero and absent from ``terms``.
    effects
        Effect name -> parameter name -> value, in the order in which they were added.
    terms
        Which of inertia, damping and stiffness the model has.
    channels
        Measured channels that its effects read, as it was declared with them.
    """

    inertia_kg_m2: float = 0.02
    damping_nm_s_rad: float = 0.045
    stiffness_nm_rad: float = 677.3
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    terms: tuple[str, ...] = TERMS
    channels: Mapping[str, Channel] = field(default_factory=dict)
