"""Runs made by the equations of motion, as an identifier gets them: samples and nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run

NOISE_RAD_S = math.radians(0.05)
TRUTH = (0.02, 0.045, 677.3)
SETS = ((111.0, 0.5), (111.0, 1.0), (104.0, 3.0), (67.0, 6.0), (42.0, 9.0))  # the paper's, within 10 deg and 400 deg/s
DECLARED = Platform(0.015, 0.1, 900.0)
Effects = Mapping[str, Mapping[str, float]]


def sine_run(
    torque_nm: float, frequency_hz: float, *, effects: Effects | None = None, duration_s: float = 4.0,
    noise: float = NOISE_RAD_S, seed: int = 0, bias: float = 0.0, jck: tuple[float, float, float] = TRUTH,
    begin_rad: float = 0.0, soft_s: float = 0.0,
) -> Run:  # fmt: skip
    """A sine set from rest at 1 kHz, read by a gyro; under dry friction it may begin stuck beside the spring's rest."""
    time = np.arange(round(duration_s * 1000) + 1) * 1e-3
    x = np.minimum(time / soft_s, 1.0) if soft_s else np.ones_like(time)
    swell = x**3 * (10.0 + x * (6.0 * x - 15.0))
    torque = TorqueSignal(time, torque_nm * swell * np.sin(2 * np.pi * frequency_hz * time))
    platform = Platform(*jck, effects or {})
    rate = simulate(platform, time, torque, start=(begin_rad, 0.0), substeps=16).sensed_rate_rad_s
    rate = rate + bias + noise * np.random.default_rng([seed, round(10 * frequency_hz)]).standard_normal(len(time))
    return Run(
        f"{frequency_hz:g} Hz", time, np.ones(len(time), bool), rate_rad_s=rate, torque_time_s=time,
        torque_nm=torque.torque_nm, frequency_hz=frequency_hz,
    )  # fmt: skip


def campaign(
    effects: Effects | None = None, *, sets: Sequence[tuple[float, float]] = SETS, duration_s: float = 4.0,
    noise: float = NOISE_RAD_S, seed: int = 0, bias: float = 0.0,
) -> Recording:  # fmt: skip
    """Several sine sets of one platform."""
    runs = [sine_run(m, f, effects=effects, duration_s=duration_s, noise=noise, seed=seed, bias=bias) for m, f in sets]
    return Recording(tuple(runs))


def traces_of(recording: Recording) -> list[Trace]:
    """The runs as the fits take them."""
    return [prepare(run, i, recording.noise) for i, run in enumerate(recording.runs)]


def decay_run(
    platform: Platform, angle_rad: float = 0.3, duration_s: float = 20.0, noise_rad: float = 1e-4, seed: int = 0
) -> Run:
    """A free decay at 200 Hz, read by an encoder."""
    time = np.arange(round(duration_s * 200) + 1) * 5e-3
    angle = simulate(platform, time, None, start=(angle_rad, 0.0), substeps=16).angle_rad
    angle = angle + noise_rad * np.random.default_rng(seed).standard_normal(len(time))
    return Run("decay", time, np.ones(len(time), bool), angle_rad=angle)


def white(n: int, sigma: float = 1.0, seed: int = 0) -> Array:
    """White noise, shape (n,)."""
    return sigma * np.random.default_rng(seed).standard_normal(n)
