"""The prediction of what a gyro reads behind its own symmetric low-pass, which sees what is still to come."""

from __future__ import annotations

import numpy as np
import pytest

from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.dynamics.gains import Noise, Sensing, gains_of
from rig.dynamics.linear_part import LinearPart
from rig.dynamics.low_pass import corner_table, low_pass_kernel, smoothed
from rig.dynamics.predictor import predict_ahead
from rig.platform import Platform

JCK = (0.0203, 0.0447, 681.2)
LOW_PASS = (262.0, 2.2e-3)  # corner in Hz and delay in s of a STIM300
STEP_S, COUNT, PARTS = 0.5e-3, 3000, 4
TRUTH_PARTS = 64
NOISE_RAD_S = 8.7e-4  # of the gyro
SEAM = 6  # samples
COULOMB = {"coulomb_friction": {"level": 1.0}}


def held_torque(frequency_hz: float = 3.0) -> TorqueSignal:
    """As a drive applies it: a thousand values a second, between the samples of the gyro."""
    time = 0.3e-3 + 1e-3 * np.arange(-20, 1600)
    torque = np.where(time > 0.0, 0.12 * np.round(70.0 * np.sin(2.0 * np.pi * frequency_hz * time) / 0.12), 0.0)
    return TorqueSignal(time, torque, "zero_order")


def read_by_a_gyro(platform: Platform, torque: TorqueSignal) -> Array:
    """Finely simulated from rest, and averaged as the filter does, shape (COUNT,)."""
    step_s = STEP_S / TRUTH_PARTS
    fine = Grid(STEP_S * np.arange(COUNT + 10), torque, TRUTH_PARTS)
    equations = Equations(platform)
    rate = equations.integrate(fine.shaft_torque(equations), fine.step_s, (0.0, 0.0))[:, 1]
    return smoothed(rate, low_pass_kernel(*LOW_PASS, step_s))[: COUNT * TRUTH_PARTS : TRUTH_PARTS]


def predicted(
    platform: Platform, torque: TorqueSignal, low_pass: tuple[float, float] | None, measured: Array, first: int = 0
) -> Array:
    """By the simulation alone: no torque disturbs, and only where a run is cut the first samples correct it."""
    equations = Equations(platform)
    grid = Grid(STEP_S * np.arange(COUNT), torque, PARTS)
    keep = np.zeros(COUNT, dtype=bool)
    spans = [(first, COUNT - 1)]
    gains = gains_of(LinearPart(*JCK), Noise(), STEP_S, Sensing(True), keep, spans)
    smoothing = None if low_pass is None else grid.smoothing(equations, low_pass)
    start = np.zeros((1, 2))
    if first:
        fine = Grid(STEP_S * np.arange(COUNT), torque, TRUTH_PARTS)
        motion = equations.integrate(fine.shaft_torque(equations), fine.step_s, (0.0, 0.0))
        start = motion[first * TRUTH_PARTS, :2][None]
    out, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, PARTS, spans, start, measured[:, None], keep, gains,
        True, 0.0, low_pass=low_pass, smoothing=smoothing,
    )  # fmt: skip
    return out[:, 0]


def rms(values: Array) -> float:
    """Without the ends, where the filter mixes the run with what is beyond it; no fit counts them."""
    return float(np.sqrt(np.mean(values[SEAM:-SEAM] ** 2)))


def test_a_linear_platform_is_predicted_as_the_filter_shows_it() -> None:
    platform, torque = Platform(*JCK), held_torque()
    read = read_by_a_gyro(platform, torque)
    left = rms(predicted(platform, torque, LOW_PASS, read) - read)
    assert left < 0.02 * NOISE_RAD_S
    assert left < 0.05 * rms(predicted(platform, torque, None, read) - read)  # the ripple of the held torque


@pytest.mark.parametrize("frequency_hz", [1.0, 3.0, 6.0])
def test_where_friction_turns_the_platform_the_corner_is_rounded(frequency_hz: float) -> None:
    platform, torque = Platform(*JCK, COULOMB), held_torque(frequency_hz)
    read = read_by_a_gyro(platform, torque)
    left = rms(predicted(platform, torque, LOW_PASS, read) - read)
    assert left < 0.3 * NOISE_RAD_S
    assert left < 0.3 * rms(predicted(platform, torque, None, read) - read)


def test_a_run_that_is_cut_begins_as_far_beside_the_platform_as_the_filter_has_it_by_then() -> None:
    platform, torque = Platform(*JCK), held_torque()
    read, first = read_by_a_gyro(platform, torque), 1234
    left = (predicted(platform, torque, LOW_PASS, read, first) - read)[first:]
    assert rms(left) < 0.05 * NOISE_RAD_S


def test_what_a_corner_adds_is_what_the_kernel_makes_of_it() -> None:
    step_s = LOW_PASS[1] / 200.0
    beside = step_s * np.arange(-600, 601)
    added = 0.5 * (smoothed(np.abs(beside), low_pass_kernel(*LOW_PASS, step_s)) - np.abs(beside))
    table = corner_table(*LOW_PASS)
    at = np.linspace(0.0, LOW_PASS[1], len(table))
    assert table == pytest.approx(np.interp(at, beside, added), abs=3e-6)
    assert abs(table[-1]) < 1e-7
