"""The guard: every limit that a campaign may not break, looked at on every tick."""

from rig.guard.base import Check, Rest, Tick, TorqueHistory, Trip
from rig.guard.guard import CHECKS, Guard
from rig.guard.motion import motion_checks

__all__ = ["CHECKS", "Check", "Guard", "Rest", "Tick", "TorqueHistory", "Trip", "motion_checks"]
