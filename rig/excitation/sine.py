"""The paper's excitation (Fig. 6): x(t) = A sin(2 pi f t)."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from rig.excitation.base import ExcitationSet, NotNegative, Positive, rise


class Sine(ExcitationSet):
    """A sine from rest.

    Without a soft start the platform's own ring is part of the motion, and it is the ring that lets a
    single tone determine inertia and stiffness apart. ``soft_start_s`` takes the ring away.
    """

    kind: Literal["sine"] = "sine"
    """sine, the default; or multisine, chirp, ramp_hold_release, free_decay."""
    torque_nm: Positive
    """Amplitude, N m."""
    frequency_hz: Positive
    """Frequency, Hz."""
    soft_start_s: NotNegative = 0.0
    """Smooth rise of the amplitude, s; it takes the ring of the platform away."""

    @property
    def sine_hz(self) -> float:
        """The excitation frequency."""
        return self.frequency_hz

    def describe(self) -> str:
        """ "0.5 Hz"."""
        return f"{self.frequency_hz:g} Hz" + (" soft" if self.soft_start_s else "")

    def shape(self, time_s: Any) -> Any:
        """A sin(2 pi f t), times a smooth rise where a soft start is asked for."""
        sine = self.torque_nm * np.sin(2.0 * math.pi * self.frequency_hz * time_s)
        return sine * rise(time_s / self.soft_start_s) if self.soft_start_s else sine
