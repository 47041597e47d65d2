"""Platforms that a measured channel acts on, by equations and an integrator that are scipy's and not the product's."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from rig.channels import Channel
from rig.recording.run import Recording, Run

J, C, K = 0.0203, 0.0447, 677.3
TRUTH = (J, C, K)
NOISE_RAD_S = math.radians(0.05)
SETS = ((0.5, 80.0), (3.0, 70.0), (9.0, 30.0))  # Hz, N m
PAUSE_S = 10.0  # from the start of one set to that of the next: what is warm stays warm

Scalar = Callable[[float], Any]
Shaft = Callable[[float, float, float], float]  # time of the campaign, torque asked, rate -> torque on the shaft
Load = Callable[[float, float, float], float]  # time of the campaign, angle, rate -> torque that resists


def as_asked(_time: float, torque: float, _rate: float) -> float:
    return torque


def nothing(_time: float, _angle: float, _rate: float) -> float:
    return 0.0


def played(
    channel: Channel, reading: Scalar, *, load: Load = nothing, shaft: Shaft = as_asked, reading_noise: float = 0.02,
    seed: int = 0, duration_s: float = 2.5, sets: Sequence[tuple[float, float]] = SETS,
) -> Recording:  # fmt: skip
    """A campaign from rest, set by set, with the channel as a noisy sensor beside it reads it."""
    rng = np.random.default_rng(seed)
    runs = []
    for i, (hz, peak) in enumerate(sets):
        begin = PAUSE_S * i
        time = np.arange(round(duration_s * 1000.0) + 1) * 1e-3

        def moves(t: float, y: Any, hz: float = hz, peak: float = peak, begin: float = begin) -> list[float]:
            angle, rate = y
            torque = shaft(begin + t, peak * math.sin(2.0 * math.pi * hz * t), rate)
            return [rate, (torque - C * rate - K * angle - load(begin + t, angle, rate)) / J]

        solved = solve_ivp(
            moves, (0.0, time[-1]), [0.0, 0.0], t_eval=time, method="DOP853", rtol=1e-9, atol=1e-11, max_step=4e-3
        )
        values = np.array([reading(begin + t) for t in time])
        runs.append(run(f"{hz:g} Hz", time, peak * np.sin(2.0 * np.pi * hz * time), solved.y[1], channel, values, rng,
                        reading_noise, hz))  # fmt: skip
    return Recording(tuple(runs))


def run(
    name: str, time: Any, torque: Any, rate: Any, channel: Channel, values: Any, rng: np.random.Generator,
    reading_noise: float, hz: float,
) -> Run:  # fmt: skip
    return Run(
        name=name, time_s=time, valid=np.ones(len(time), dtype=bool),
        rate_rad_s=rate + NOISE_RAD_S * rng.normal(size=len(time)), torque_time_s=time, torque_nm=torque,
        frequency_hz=hz, channels={channel.name: values + reading_noise * rng.normal(size=len(time))},
        causes={channel.name: channel},
    )  # fmt: skip


def sagging(torque_constant: float, seed: int = 0, duration_s: float = 2.5, reading_noise: float = 0.0005) -> Recording:
    """A drive whose bus sags under what it gives: a third state, so that the current departs from what was asked."""
    rng = np.random.default_rng(seed)
    runs = []
    for hz, peak in SETS:
        time = np.arange(round(duration_s * 1000.0) + 1) * 1e-3

        def moves(t: float, y: Any, hz: float = hz, peak: float = peak) -> list[float]:
            angle, rate, sag = y
            asked = peak * math.sin(2.0 * math.pi * hz * t)
            given = asked * (1.0 - 0.05 * sag)
            return [rate, (given - C * rate - K * angle) / J, (abs(asked) / 80.0 - sag) / 0.3]

        solved = solve_ivp(
            moves, (0.0, time[-1]), [0.0] * 3, t_eval=time, method="DOP853", rtol=1e-9, atol=1e-11, max_step=4e-3
        )
        asked = peak * np.sin(2.0 * np.pi * hz * time)
        current = asked * (1.0 - 0.05 * solved.y[2]) / torque_constant
        channel = Channel("motor_current", "current", factor=torque_constant)
        runs.append(run(f"{hz:g} Hz", time, asked, solved.y[1], channel, current, rng, reading_noise, hz))
    return Recording(tuple(runs))


def random_walk(seed: int, step: float = 0.02) -> Scalar:
    """A temperature that wanders and acts on nothing."""
    walk = 21.0 + np.cumsum(np.random.default_rng(seed).normal(size=100_000)) * step
    return lambda t: walk[round(1000.0 * t)]
