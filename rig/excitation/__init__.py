"""Excitation sets: torque as a pure function of time.

A new kind is one class here and one line in the union of ``rig.config.excitation``.
"""

from __future__ import annotations

from rig.excitation.base import ExcitationSet
from rig.excitation.broadband import Chirp, Multisine
from rig.excitation.compensated import CompensatedSet, HeldCommands, TorqueTable
from rig.excitation.planned import PlannedSet, planned
from rig.excitation.ramps import FreeDecay, RampHoldRelease
from rig.excitation.sine import Sine

__all__ = [
    "Chirp",
    "CompensatedSet",
    "ExcitationSet",
    "FreeDecay",
    "HeldCommands",
    "Multisine",
    "PlannedSet",
    "RampHoldRelease",
    "Sine",
    "TorqueTable",
    "planned",
]
