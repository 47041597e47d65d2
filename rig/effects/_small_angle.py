"""Up to which travel gravity and a polynomial spring are one torque."""

from __future__ import annotations

from rig.effects.base import Alike

TRAVEL_DEG = 12.0  # the paper's 10, and what a start transient or the drift of an integrated rate adds
_CURE = "turning the base or swinging farther tells them apart"

# What the next term of either series adds there is some millionths of the torque.
SINE = Alike("sin(th) is th - th^3/6", TRAVEL_DEG, _CURE)
COSINE = Alike("cos(th) is 1 - th^2/2", TRAVEL_DEG, _CURE)
