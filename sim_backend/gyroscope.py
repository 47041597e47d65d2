"""The simulated gyroscope: bandwidth, delay, bias, white noise, quantisation and full scale, in that order."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rig.arrays import Array
from rig.interface import GyroSample

if TYPE_CHECKING:
    from rig.config.simulated import SimulatedGyro

NOISE_BLOCK = 4096


class Butterworth:
    """Second-order low-pass on a fine time grid (bilinear with the corner prewarped), sample by sample."""

    def __init__(self, bandwidth_hz: float, step_s: float) -> None:
        k = math.tan(math.pi * bandwidth_hz * step_s)
        norm = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
        self._b = k * k * norm
        self._a1 = 2.0 * (k * k - 1.0) * norm
        self._a2 = (1.0 - math.sqrt(2.0) * k + k * k) * norm
        self._s1 = self._s2 = 0.0

    def __call__(self, x: float) -> float:
        """The next sample behind the filter (transposed direct form II)."""
        y = self._b * x + self._s1
        self._s1 = 2.0 * self._b * x - self._a1 * y + self._s2
        self._s2 = self._b * x - self._a2 * y
        return y


def group_delay_s(bandwidth_hz: float | None) -> float:
    """Delay of the low-pass well below its corner: sqrt(2) / (2 pi f)."""
    return math.sqrt(2.0) / (2.0 * math.pi * bandwidth_hz) if bandwidth_hz else 0.0


class Gyroscope:
    """Turns the rate on the plant's fine grid into samples with time stamps.

    Parameters
    ----------
    config
        Its data sheet.
    step_s
        The plant's fine step; ``every`` of them make one sample.
    seed
        All streams derive from it; ``restart`` begins the independent stream of a set.
    """

    def __init__(self, config: SimulatedGyro, step_s: float, every: int, seed: int) -> None:
        self._every = every
        self._seed = seed
        self._sigma = math.radians(config.noise_deg_s)
        self._bias = math.radians(config.bias_deg_s)
        self._resolution = math.radians(config.resolution_deg_s or 0.0)
        self._full_scale = math.radians(config.full_scale_deg_s) if config.full_scale_deg_s else math.inf
        self._lowpass = Butterworth(config.bandwidth_hz, step_s) if config.bandwidth_hz else None
        known = config.corrected_delay_s
        true_delay = config.delay_s + group_delay_s(config.bandwidth_hz)
        self._stamp_s = config.delay_s - (true_delay if known is None else known)
        self._arrival_s = config.delay_s
        self._period_s = every * step_s
        self._in_flight: list[tuple[float, GyroSample]] = []
        self.restart(0)

    @property
    def delay_s(self) -> float:
        """From the instant of a sample until it reaches the host."""
        return self._arrival_s

    def restart(self, index: int) -> None:
        """Begin the noise stream of set ``index`` (0 belongs to the rests)."""
        self._rng = np.random.default_rng([self._seed, index])
        self._noise: list[float] = []

    def _next_noise(self) -> float:
        if not self._noise:
            self._noise = (self._sigma * self._rng.standard_normal(NOISE_BLOCK)).tolist()
        return self._noise.pop()

    def _read(self, rate_rad_s: float, time_s: float) -> GyroSample:
        reading = rate_rad_s + self._bias
        if self._sigma:
            reading += self._next_noise()
        if self._resolution:
            reading = self._resolution * round(reading / self._resolution)
        if abs(reading) >= self._full_scale:
            return GyroSample(time_s + self._stamp_s, math.copysign(self._full_scale, reading), False)
        return GyroSample(time_s + self._stamp_s, reading, True)

    def sense(self, rate_rad_s: Array, first: int, n: int, now_s: float) -> list[GyroSample]:
        """Samples that have reached the host by ``now_s``.

        ``rate_rad_s`` (n or more,) is the rate at the ends of fine steps ``first + 1`` to ``first + n``,
        counted from time zero.
        """
        if self._lowpass is not None:
            lowpass = self._lowpass
            rate_rad_s = np.array([lowpass(x) for x in rate_rad_s[:n].tolist()])
        every, period = self._every, self._period_s
        k = first // every + 1
        samples = []
        for at in range(k * every - first - 1, n, every):
            samples.append(self._read(float(rate_rad_s[at]), k * period))
            k += 1
        if not self._arrival_s:
            return samples
        self._in_flight += [(s.time_s - self._stamp_s + self._arrival_s, s) for s in samples]
        arrived = [s for at_s, s in self._in_flight if at_s <= now_s + 1e-12]
        self._in_flight = self._in_flight[len(arrived) :]
        return arrived
