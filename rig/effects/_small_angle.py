"""The travel up to which the torque of gravity cannot be separated from a polynomial spring."""

from __future__ import annotations

from rig.effects.base import Alike

# Degrees to either side: the paper's platform moves 10, the start transient and the drift of an integrated rate add 5.
TRAVEL_DEG = 15.0
_CURE = "turn the base of the platform, or swing farther"

# At 15 deg the next term of either series, th^5/120 or th^4/24, is below 2e-4 of the torque.
SINE = Alike("sin(th) equals th - th^3/6", TRAVEL_DEG, _CURE)
COSINE = Alike("cos(th) equals 1 - th^2/2", TRAVEL_DEG, _CURE)
