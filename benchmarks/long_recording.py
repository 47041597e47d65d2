"""Long recordings made block by block: known J, C, K and windage under a torque that never repeats.

The torque is a sum of the paper's five sines, each swelling and fading over a minute or two, so that no stretch tells
everything. Torque and windage run straight over steps of at most FINE_S.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
from numba import njit
from scipy.linalg import expm

from rig.arrays import Array

TRUTH = {"inertia": 0.02, "damping": 0.045, "stiffness": 677.3}
WINDAGE = 0.02  # N m s^2 / rad^2: torque over the square of the rate
SINES = ((0.5, 30.0, 101.0), (1.0, 30.0, 67.0), (3.0, 28.0, 41.0), (6.0, 18.0, 29.0), (9.0, 11.0, 23.0))  # Hz, N m, s
NOISE_RAD_S = math.radians(0.05)
FINE_S = 1e-4  # the ring's period is 34 ms; the error of a step is of second order
BLOCK = 1 << 18


def torque_at(time_s: Array) -> Array:
    """The torque in N m, shape as ``time_s``."""
    out = np.zeros_like(time_s)
    for frequency_hz, peak_nm, swell_s in SINES:
        envelope = 0.6 + 0.4 * np.sin(2.0 * math.pi * time_s / swell_s)
        out += peak_nm * envelope * np.sin(2.0 * math.pi * frequency_hz * time_s)
    return out


@njit(cache=True)
def _rates(
    torque: Array, state: Array, a: Array, b0: Array, b1: Array, windage: float, fine: int, rate: Array
) -> None:  # pragma: no cover (compiled)
    """Angle and rate at the end of each fine step, the rate of every ``fine``-th kept; ``state`` is carried on."""
    x, v, before = state[0], state[1], state[2]
    for i in range(len(torque)):
        drag = windage * v * abs(v)
        ahead = a[1, 0] * x + a[1, 1] * v + b0[1] * (before - drag) + b1[1] * (torque[i] - drag)
        low, high = before - drag, torque[i] - windage * ahead * abs(ahead)
        x, v = (
            a[0, 0] * x + a[0, 1] * v + b0[0] * low + b1[0] * high,
            a[1, 0] * x + a[1, 1] * v + b0[1] * low + b1[1] * high,
        )
        before = torque[i]
        if (i + 1) % fine == 0:
            rate[i // fine] = v
    state[0], state[1], state[2] = x, v, before


def _hold(step_s: float) -> tuple[Array, Array, Array]:
    """Transition of angle and rate over a step under a torque that runs straight."""
    j, c, k = TRUTH.values()
    whole = np.zeros((4, 4))
    whole[:2, :2] = [[0.0, 1.0], [-k / j, -c / j]]
    whole[1, 2] = 1.0 / j
    whole[2, 3] = 1.0 / step_s
    step = expm(whole * step_s)
    return np.ascontiguousarray(step[:2, :2]), step[:2, 2] - step[:2, 3], np.ascontiguousarray(step[:2, 3])


def blocks(samples: int, rate_hz: float, seed: int = 0, windage: float = WINDAGE) -> Iterator[tuple[Array, ...]]:
    """Time, torque and measured rate, each of shape (at most BLOCK,), from rest."""
    rng = np.random.default_rng([24, seed])
    step = 1.0 / rate_hz
    fine = math.ceil(step / FINE_S - 1e-9)
    a, b0, b1 = _hold(step / fine)
    state = np.zeros(3)  # angle, rate, torque at the end of the last fine step
    for first in range(0, samples, BLOCK):
        last = min(first + BLOCK, samples)
        torque = torque_at(step / fine * np.arange((first - 1) * fine + 1, (last - 1) * fine + 1))
        rate = np.empty(last - first)
        _rates(torque, state, a, b0, b1, windage, fine, rate)
        time = step * np.arange(first, last)
        yield time, torque[fine - 1 :: fine], rate + NOISE_RAD_S * rng.standard_normal(len(time))


def write_h5(path: Path, samples: int, rate_hz: float, seed: int = 0, windage: float = WINDAGE) -> None:
    """The recording as plain columns of an HDF5 file."""
    with h5py.File(path, "w") as file:
        columns = [
            file.create_dataset(name, (samples,), dtype="f8", chunks=(min(samples, BLOCK),))
            for name in ("time_s", "torque_nm", "rate_rad_s")
        ]
        at = 0
        for block in blocks(samples, rate_hz, seed, windage):
            for column, values in zip(columns, block, strict=True):
                column[at : at + len(values)] = values
            at += len(block[0])
