"""Simulated campaigns for the benchmarks: sine sets from rest in closed form, so that no integrator is shared.

J a + C w + K th = A sin(2 pi f t) from rest is a steady sine and a ring that dies away; a torque that acts
later shifts both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from identify.estimate.initial_guess import best_rho, first_guess
from identify.estimate.output_error import OutputErrorFit, refine
from identify.estimate.starting_point import start_values
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.signals.prepare import LEAD_IN_S, prepare
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.recording.run import Run

TRUTH = {"inertia": 0.02, "damping": 0.045, "stiffness": 677.3}
SETS = ((111.0, 0.5), (111.0, 1.0), (104.0, 3.0), (67.0, 6.0), (42.0, 9.0))  # N m, Hz: within 10 deg and 400 deg/s
SIGMA_RAD_S = math.radians(0.05)
SAMPLE_S = 1e-3
DURATION_S = 10.0
DELAY = "torque_delay"
DELAY_NAME = (DELAY, "delay")


def times(duration_s: float = DURATION_S) -> Array:
    """Sample instants, 1 kHz, shape (n,)."""
    return np.arange(round(duration_s / SAMPLE_S) + 1) * SAMPLE_S


def sine_rate(time_s: Array, torque_nm: float, frequency_hz: float, delay_s: float = 0.0) -> Array:
    """Rate in rad/s of the platform driven from rest, shape as ``time_s``."""
    j, c, k = TRUTH.values()
    w = 2.0 * math.pi * frequency_hz
    steady = torque_nm / (k - j * w * w + 1j * c * w)  # angle is Im(steady exp(iwt)) and a ring
    pole = (-c + np.sqrt(complex(c * c - 4.0 * j * k))) / (2.0 * j)
    real, imaginary = np.linalg.solve([[1.0, 0.0], [pole.real, -pole.imag]], [-steady.imag, -(1j * w * steady).imag])
    ring = complex(real, imaginary)
    t = np.maximum(time_s - delay_s, 0.0)
    rate = (steady * 1j * w * np.exp(1j * w * t)).imag + (ring * pole * np.exp(pole * t)).real
    return np.where(time_s > delay_s, rate, 0.0)


def run_of(rate_rad_s: Array, torque_nm: float, frequency_hz: float, lost: Array | None = None) -> Run:
    """A recorded run; samples flagged in ``lost`` did not arrive."""
    time = SAMPLE_S * np.arange(len(rate_rad_s))
    kept = np.ones(len(time), dtype=bool) if lost is None else ~lost.astype(bool)
    return Run(
        f"{frequency_hz:g} Hz", time[kept], np.ones(int(kept.sum()), dtype=bool), rate_rad_s=rate_rad_s[kept],
        torque_time_s=time, torque_nm=torque_nm * np.sin(2.0 * math.pi * frequency_hz * time),
        frequency_hz=frequency_hz,
    )  # fmt: skip


def clean_rates(delay_s: float = 0.0, sets: Sequence[tuple[float, float]] = SETS) -> list[Array]:
    """Noise-free rate of every set."""
    return [sine_rate(times(), a, f, delay_s) for a, f in sets]


def traces_from(
    rates: Sequence[Array],
    noise: Sequence[Array],
    lost: Sequence[Array] | None = None,
    sigma: float | None = SIGMA_RAD_S,
    lead_in_s: float = LEAD_IN_S,
) -> list[Trace]:
    """The sets as the fit takes them; ``sigma`` None lets it estimate the noise."""
    parts = []
    for i, ((a, f), rate, e) in enumerate(zip(SETS, rates, noise, strict=True)):
        parts.append(prepare(run_of(rate + e, a, f, None if lost is None else lost[i]), i, sigma, lead_in_s))
    return parts


def white(rng: np.random.Generator, count: int = len(SETS)) -> list[Array]:
    """White gyro noise for every set."""
    return [SIGMA_RAD_S * rng.standard_normal(len(times())) for _ in range(count)]


def structure_with(delay: bool) -> Structure:
    """J, C, K, and an unknown torque delay where asked for."""
    return Structure(effects=(DELAY,) if delay else ())


def regression_start(traces: Sequence[Trace], structure: Structure) -> dict[Name, float]:
    """Where output error starts: the white-residual regression, nothing known beforehand."""
    shapes = {DELAY: (SAMPLE_S,)} if structure.effects else {}
    guess = first_guess(traces, structure.minus(DELAY))
    return start_values(best_rho(traces, structure, shapes, guess), shapes, len(traces))


def alone(trace: Trace) -> list[Trace]:
    """One set as a recording of its own."""
    return [prepare(trace.run, 0, trace.noise)]


def fitted(traces: Sequence[Trace], structure: Structure, start: Mapping[Name, float]) -> OutputErrorFit:
    """Output error over whole runs."""
    return refine(traces, structure, start)
