"""A servo in closed loop as a bench records it: measured current, an encoder in steps, a torque that nobody records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.arrays import Array
from rig.dynamics import Stepper
from rig.platform import Platform
from rig.recording.run import Recording, Run

STEP_S = 1e-3
COUNTS = 2.0 * np.pi / 100_000
Effects = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Servo:
    """Inertia, damping and stiffness, what the declared model lacks, and how large the unrecorded torque is."""

    inertia: float = 2e-3
    damping: float = 4e-3
    stiffness: float = 0.0
    effects: Effects | None = None
    white: float = 0.01  # of the torque, root mean square up to half the sample rate
    slow: float = 0.005  # of the torque, with a time constant of 0.3 s

    def run(self, seed: int, duration_s: float = 8.0) -> Run:
        """One run under a position loop that follows a sum of sines."""
        rng = np.random.default_rng(seed)
        n = round(duration_s / STEP_S)
        time = STEP_S * np.arange(n)
        phases = rng.uniform(0.0, 2.0 * np.pi, 4)
        hertz = np.array([0.35, 0.8, 1.7, 3.1])
        wanted = np.sum(np.array([1.0, 0.5, 0.2, 0.08]) * np.sin(2.0 * np.pi * np.outer(time, hertz) + phases), axis=1)
        wanted -= wanted[0]
        torque = self._played(wanted, np.zeros(n))[1]
        size = float(np.sqrt(np.mean(torque**2)))
        slow = np.zeros(n)
        decay = np.exp(-STEP_S / 0.3)
        kicks = self.slow * size * np.sqrt(1.0 - decay**2) * rng.standard_normal(n)
        for i in range(1, n):
            slow[i] = decay * slow[i - 1] + kicks[i]
        angle, torque = self._played(wanted, slow + self.white * size * rng.standard_normal(n))
        steps = np.rint(angle / COUNTS) * COUNTS
        return Run(
            f"run {seed}", time, np.ones(n, dtype=bool), angle_rad=steps, torque_nm=torque, torque_time_s=time,
            torque_hold="zero_order",
        )  # fmt: skip

    def _played(self, wanted: Array, disturbance: Array) -> tuple[Array, Array]:
        """Angle and torque at every sample: the loop sees the encoder."""
        platform = Platform(self.inertia, self.damping, self.stiffness, dict(self.effects or {}))
        stepper = Stepper(platform, STEP_S)
        angle, rate = 0.0, 0.0
        stiff = self.inertia * (2.0 * np.pi * 12.0) ** 2
        damp = 1.4 * self.inertia * 2.0 * np.pi * 12.0
        angles, torques = np.empty(len(wanted)), np.empty(len(wanted))
        speed = np.gradient(wanted, STEP_S)
        for i in range(len(wanted)):
            seen = round(angle / COUNTS) * COUNTS
            torques[i] = stiff * (wanted[i] - seen) + damp * (speed[i] - rate)
            angles[i] = angle
            total = torques[i] + disturbance[i]
            angle, rate, _, _ = stepper.advance(total, total)
        return angles, torques

    def recording(self, runs: int = 3) -> Recording:
        """Several runs with other phases and other disturbances."""
        return Recording(tuple(self.run(seed) for seed in range(1, runs + 1)))
