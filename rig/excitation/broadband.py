"""Many frequencies in one set: a multisine and a chirp."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rig.arrays import Array
from rig.excitation.base import ExcitationSet, NotNegative, Positive, rise


class Multisine(ExcitationSet):
    """A sum of equal sines whose phases keep the peak low; ``torque_nm`` is the peak of the sum.

    Frequencies are listed, or spread over a band. Phases after Schroeder (IEEE Trans. Inf. Theory 16,
    1970: phi_k = -pi k (k - 1) / n) or drawn with a seed.
    """

    kind: Literal["multisine"]
    """A sum of sines whose phases keep the peak low."""
    torque_nm: Positive
    """Peak of the sum, N m."""
    frequencies_hz: Annotated[tuple[Positive, ...], Field(max_length=500)] = ()
    """The frequencies, Hz; or give from_hz and to_hz."""
    from_hz: Positive | None = None
    """Lowest frequency of the band, Hz."""
    to_hz: Positive | None = None
    """Highest frequency of the band, Hz."""
    tones: Annotated[int, Field(ge=2, le=500)] = 20
    """Number of sines in the band."""
    phases: Literal["schroeder", "random"] = "schroeder"
    """schroeder: a low peak; random: drawn with the seed."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of random phases."""
    soft_start_s: NotNegative = 0.0
    """Smooth rise of the amplitude, s."""

    @model_validator(mode="after")
    def _list_or_band(self) -> Self:
        band = self.from_hz is not None and self.to_hz is not None
        if band == bool(self.frequencies_hz) or (self.from_hz is None) != (self.to_hz is None):
            raise ValueError("give either frequencies_hz or both from_hz and to_hz")
        if self.from_hz is not None and self.to_hz is not None and self.from_hz >= self.to_hz:
            raise ValueError(f"from_hz = {self.from_hz:g} must lie below to_hz = {self.to_hz:g}")
        return self

    def describe(self) -> str:
        """ "multisine 0.5-40 Hz"."""
        return f"multisine {self._hz[0]:g}-{self._hz[-1]:g} Hz"

    @cached_property
    def _hz(self) -> Array:
        if self.from_hz is None or self.to_hz is None:
            return np.array(sorted(self.frequencies_hz))
        # Whole cycles over the set, so that the tones are orthogonal and the torque ends where it began.
        cycles = np.linspace(self.from_hz, self.to_hz, self.tones) * self.duration_s
        return np.unique(np.maximum(1.0, np.round(cycles))) / self.duration_s

    @cached_property
    def _phase_rad(self) -> Array:
        n = len(self._hz)
        if self.phases == "random":
            return np.random.default_rng(self.seed).uniform(0.0, 2.0 * math.pi, n)
        k = np.arange(1, n + 1)
        return -math.pi * k * (k - 1) / n

    def _sum(self, time_s: Any) -> Any:
        return np.sin(2.0 * math.pi * np.multiply.outer(time_s, self._hz) + self._phase_rad).sum(axis=-1)

    @cached_property
    def _peak(self) -> float:
        # A hundred points a cycle find the peak within 0.05 %; a very long set is looked at more coarsely.
        n = math.ceil(min(100.0 * float(self._hz[-1]) * self.duration_s, 1e8 / len(self._hz))) + 1
        times = np.linspace(0.0, self.duration_s, n)
        return max(float(np.abs(self._sum(part)).max()) for part in np.array_split(times, 1 + n // 20_000))

    def shape(self, time_s: Any) -> Any:
        """Torque in N m."""
        torque = self._sum(time_s) * (self.torque_nm / self._peak)
        return torque * rise(time_s / self.soft_start_s) if self.soft_start_s else torque


class Chirp(ExcitationSet):
    """A sine whose frequency runs from one end of a band to the other over the set."""

    kind: Literal["chirp"]
    """A sine whose frequency runs through a band."""
    torque_nm: Positive
    """Amplitude, N m."""
    from_hz: Positive
    """Frequency at the start, Hz."""
    to_hz: Positive
    """Frequency at the end, Hz."""
    sweep: Literal["linear", "logarithmic"] = "linear"
    """How the frequency runs."""
    soft_start_s: NotNegative = 0.0
    """Smooth rise of the amplitude, s."""

    def describe(self) -> str:
        """ "chirp 0.5-20 Hz"."""
        return f"chirp {self.from_hz:g}-{self.to_hz:g} Hz"

    def shape(self, time_s: Any) -> Any:
        """Torque in N m: A sin of the integral of the frequency."""
        f0, f1, span = self.from_hz, self.to_hz, self.duration_s
        if self.sweep == "linear" or f0 == f1:
            cycles = f0 * time_s + 0.5 * (f1 - f0) / span * time_s**2
        else:
            # Outside the set the exponential could overflow; the torque is zero there anyway.
            inside = np.clip(time_s, 0.0, span)
            cycles = f0 * span / math.log(f1 / f0) * (np.power(f1 / f0, inside / span) - 1.0)
        torque = self.torque_nm * np.sin(2.0 * math.pi * cycles)
        return torque * rise(time_s / self.soft_start_s) if self.soft_start_s else torque
