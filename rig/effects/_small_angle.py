"""Up to which travel gravity and a polynomial spring are one torque."""

from __future__ import annotations

from rig.effects.base import Alike

TRAVEL_DEG = 15.0  # the paper's 10, a start transient, and what the drift of an integrated rate adds
_CURE = "turning the base or swinging farther tells them apart"

# The next term of either series adds less than a ten-thousandth of the torque there.
SINE = Alike("sin(th) is th - th^3/6", TRAVEL_DEG, _CURE)
COSINE = Alike("cos(th) is 1 - th^2/2", TRAVEL_DEG, _CURE)
