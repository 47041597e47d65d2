"""Excitation sets: torque as a pure function of time. A new kind is one class and one line in ``KINDS``."""

from __future__ import annotations

from rig.excitation.base import ExcitationSet
from rig.excitation.broadband import Chirp, Multisine
from rig.excitation.ramps import FreeDecay, RampHoldRelease
from rig.excitation.sine import Sine

KINDS: dict[str, type[ExcitationSet]] = {
    "sine": Sine,
    "ramp_hold_release": RampHoldRelease,
    "multisine": Multisine,
    "chirp": Chirp,
    "free_decay": FreeDecay,
}

__all__ = ["KINDS", "Chirp", "ExcitationSet", "FreeDecay", "Multisine", "RampHoldRelease", "Sine"]
