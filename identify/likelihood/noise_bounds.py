"""How large and how fast each number of the noise may be, in shares of the torque and of what is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.signals.filtered_noise import filtered_density
from identify.signals.trace import MOST_WALK
from rig.arrays import Array
from rig.dynamics.gains import Noise

LONGEST_SHARE = 0.2  # of the longest run: a disturbance slower than that is a constant
SHORTEST_SAMPLES = 4.0  # time constant of a disturbance, in samples: a faster one is white
MIN_DISTURBANCE, MAX_DISTURBANCE = 1e-7, 10.0  # of the torque: how large a disturbance may be
# Of the torque, how large a smooth disturbance may be: a larger one follows the motion wherever it goes, whatever the
# recorded torque says, and a noisy record of the torque would then be taken for no record at all.
MAX_SMOOTH = 0.1
MIN_BIAS_WALK, MAX_BIAS_WALK = 1e-7, MOST_WALK  # of the rate, that a gyro's bias walks over a run
MAX_ENCODER_ERROR = 1.0  # of the angle, that an encoder's slow error takes over a run
# Times the variance of one reading, of what a gyro's low-pass lets through of the noise ahead of it.
MIN_PREFILTER_NOISE, MAX_PREFILTER_NOISE = 1e-4, 1e8
FAR = 1e30  # times a number of the noise: a bound holds it


@dataclass(frozen=True)
class NoiseBounds:
    """Of the runs of one problem.

    Attributes
    ----------
    torque_nm, moved
        Of the torque and of what a sensor's slow error adds to (a gyro's rate, an encoder's angle), root mean square.
    step_s, longest_s
        A sample, and the longest run.
    reading_variance
        Of the sensor's noise: what all numbers of the noise are in relation to.
    gyro, wanders
        Whether a gyro is read, and whether the sensor's slow error counts.
    """

    torque_nm: float
    moved: float
    step_s: float
    longest_s: float
    reading_variance: float
    gyro: bool
    wanders: bool

    @property
    def slowest_s(self) -> float:
        """Longest time constant of a disturbance, s."""
        return max(LONGEST_SHARE * self.longest_s, 10.0 * SHORTEST_SAMPLES * self.step_s)

    def white(self, share: float) -> float:
        """Density of a white torque that is this share of the torque, as ``Noise`` has it."""
        return (share * self.torque_nm) ** 2 * 2.0 * self.step_s / self.reading_variance

    def slow(self, share: float) -> float:
        """Variance of a slow torque that is this share of the torque, as ``Noise`` has it."""
        return (share * self.torque_nm) ** 2 / self.reading_variance

    def within(self, noise: Noise) -> Noise:
        """The nearest noise that is neither absurdly large nor without effect."""
        walks = MAX_BIAS_WALK if self.gyro else MAX_ENCODER_ERROR
        return Noise(
            float(np.clip(noise.white, self.white(MIN_DISTURBANCE), self.white(MAX_DISTURBANCE))),
            float(np.clip(noise.slow, self.slow(MIN_DISTURBANCE), self.slow(MAX_DISTURBANCE))),
            float(np.clip(noise.time_constant_s, SHORTEST_SAMPLES * self.step_s, self.slowest_s)),
            float(np.clip(noise.walk, self.walk(MIN_BIAS_WALK), self.walk(walks))) if self.wanders else 0.0,
            float(np.clip(noise.ahead, MIN_PREFILTER_NOISE, MAX_PREFILTER_NOISE)) if self.gyro else 0.0,
            np.inf if self.gyro else float(np.clip(noise.walk_s, SHORTEST_SAMPLES * self.step_s, self.slowest_s)),
            float(np.clip(noise.smooth, self.slow(MIN_DISTURBANCE), self.slow(MAX_SMOOTH))),
        )

    def shown_above(self, noise: Noise, lag: tuple[float, float]) -> float:
        """The sensor's noise where the readings' own is read off (``noise_of``), over the variance of one reading.

        One for a sensor without a low-pass; with one, what that lets through of the noise ahead of it comes on top.
        """
        if not self.gyro or lag == (0.0, 0.0):
            return 1.0
        return 1.0 + noise.ahead * filtered_density(lag, self.step_s)

    def extremes(self, noise: Noise, kinds: Sequence[str]) -> tuple[Array, Array]:
        """By how many times itself each number of the noise may be smaller and larger, (k,) each."""

        def at(times: float) -> Array:
            far = [self.within(replace(noise, **{k: times * getattr(noise, k)})) for k in kinds]
            return np.array([getattr(q, k) / getattr(noise, k) for q, k in zip(far, kinds, strict=True)])

        return at(1.0 / FAR), at(FAR)

    def walk(self, share: float) -> float:
        """Density of a walk that takes the gyro's bias so far over a run, of its rate, as ``Noise`` has it."""
        return (share * self.moved) ** 2 / self.longest_s / self.reading_variance
