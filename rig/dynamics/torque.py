"""The torque between its samples (held or band-limited)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline

from rig.arrays import Array
from rig.dynamics.polynomials import Polynomials
from rig.signals import TorqueHold

ON_A_STEP = 1e-3  # of a step, by which an instant may be off and still be on the grid
MAX_READINGS_KEPT = 6  # readings between the samples: every fit to a run asks for one of a few
KEPT_BYTES = 64 << 20  # of them; a long run that needs fine steps is read again
AT_ONCE = 1 << 18  # instants: the times of millions would take as much memory as what is read at them


@dataclass(frozen=True)
class TorqueSignal:
    """A torque given at instants, defined in between by its hold.

    Parameters
    ----------
    time_s, torque_nm
        Shape (m,), time strictly increasing.
    hold
        "band_limited": a quintic spline through the samples (a 29 Hz sine at 1 kHz is right to 1e-7,
        a linear hold to 3e-3). "zero_order": each value is held until the next sample.
    """

    time_s: Array
    torque_nm: Array
    hold: TorqueHold = "band_limited"
    _read: dict[tuple[float, float, int], Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def _spline(self) -> Polynomials:
        k = min(5, len(self.time_s) - 1)
        k -= 1 - k % 2 if k > 1 else 0  # an odd degree
        return Polynomials(make_interp_spline(self.time_s, self.torque_nm, k=max(1, k)))

    @cached_property
    def shortest_s(self) -> float:
        """Usual time between samples in s: the median, which gaps do not move."""
        return float(np.median(np.diff(self.time_s)))

    def steps_on(self, start_s: float, step_s: float) -> bool:
        """Whether a held torque changes only at instants that are so many steps from the start."""
        at = (self.time_s - start_s) / step_s
        return bool(np.max(np.abs(at - np.rint(at))) < ON_A_STEP)

    @cached_property
    def _impulse_nm_s(self) -> Array:
        return np.concatenate([[0.0], np.cumsum(self.torque_nm[:-1] * np.diff(self.time_s))])

    def at(self, time_s: Array) -> Array:
        """Torque in N m at any instants, shape as given; constant before the first and after the last sample."""
        t = np.clip(time_s, self.time_s[0], self.time_s[-1])
        if self.hold == "zero_order":
            return self.torque_nm[np.clip(np.searchsorted(self.time_s, t, "right") - 1, 0, None)]
        return self._spline(np.asarray(t))

    def _impulse(self, t: Array) -> Array:
        inside = np.clip(t, self.time_s[0], self.time_s[-1])
        held = np.interp(inside, self.time_s, self._impulse_nm_s)
        return held + (t - inside) * np.where(t > inside, self.torque_nm[-1], self.torque_nm[0])

    def on_half_steps(self, start_s: float, half_step_s: float, n: int) -> Array:
        """Torque at n instants half a fine step apart (read-only); a held torque as its mean over the half step."""
        key = (start_s, half_step_s, n)
        found = self._read.get(key)
        if found is None:
            found = self._between(start_s, half_step_s, n)
            found.flags.writeable = False  # it is given out again
            while self._read and (
                len(self._read) >= MAX_READINGS_KEPT or self._kept_bytes() + found.nbytes > KEPT_BYTES
            ):
                # simulations in other threads may be doing the same
                self._read.pop(next(iter(self._read), key), None)
            self._read[key] = found
        return found

    def _between(self, start_s: float, half_step_s: float, n: int) -> Array:
        if self.hold == "zero_order":
            return np.diff(self._impulse(start_s + half_step_s * np.arange(n + 1, dtype=np.float64))) / half_step_s
        out = np.empty(n)
        for first in range(0, n, AT_ONCE):
            last = min(first + AT_ONCE, n)
            out[first:last] = self.at(start_s + half_step_s * np.arange(first, last, dtype=np.float64))
        return out

    def _kept_bytes(self) -> int:
        return sum(reading.nbytes for reading in list(self._read.values()))


NO_TORQUE = TorqueSignal(np.array([0.0, 1.0]), np.zeros(2), "zero_order")
