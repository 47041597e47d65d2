"""A channel in coarse steps: what it loses by them is noise, also where the platform sticks and nothing changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from identify.pipeline import identify
from identify.signals.noise import rounding_of
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run
from tests.identify.simulated import DECLARED, SETS, TRUTH, Effects, white

STEP_RAD = 2.0 * np.pi / 20000.0
TIME = np.arange(2001) * 1e-3


def swing(noise: float = 0.0) -> Array:
    return 0.1 * np.sin(20.0 * TIME) + white(len(TIME), noise) if noise else 0.1 * np.sin(20.0 * TIME)


def test_the_steps_of_an_encoder_are_read_off_its_values() -> None:
    counts = np.rint(swing() / STEP_RAD)
    assert rounding_of(STEP_RAD * counts) == pytest.approx(STEP_RAD / np.sqrt(12.0), rel=1e-9)
    shifted = 0.0123 + np.degrees(STEP_RAD * counts[::7])  # few of its levels, in degrees, with another zero
    assert rounding_of(shifted) == pytest.approx(np.degrees(STEP_RAD) / np.sqrt(12.0), rel=1e-6)


def test_what_has_no_steps_loses_nothing_by_them() -> None:
    assert rounding_of(swing(1e-4)) < 1e-6
    assert rounding_of(swing()) < 1e-6
    assert rounding_of(np.zeros(100)) is None
    assert rounding_of(np.repeat([0.0, 1.0], 50)) is None


def read_in_steps(effects: Effects, sets: Sequence[tuple[float, float]] = SETS[2:]) -> Recording:
    runs = []
    for m, f in sets:
        torque = TorqueSignal(TIME, m * np.sin(2.0 * np.pi * f * TIME))
        angle = simulate(Platform(*TRUTH, effects), TIME, torque, substeps=16).angle_rad
        runs.append(
            Run(
                f"{f:g} Hz", TIME, np.ones(len(TIME), bool), angle_rad=STEP_RAD * np.rint(angle / STEP_RAD),
                torque_time_s=TIME, torque_nm=torque.torque_nm, frequency_hz=f,
            )
        )  # fmt: skip
    return Recording(tuple(runs))


@pytest.mark.slow
def test_friction_that_holds_the_platform_beside_a_coarse_encoder_is_explained_to_the_noise() -> None:
    """Read where it stood still, the noise was a third of what the steps leave, and nothing came down to it."""
    settings = IdentifyConfig.model_validate({"candidates": ["coulomb_friction", "cubic_stiffness", "torque_delay"]})
    found = identify(read_in_steps({"coulomb_friction": {"level": 1.0}}), DECLARED, settings)
    assert found.verdict.effects == ("coulomb_friction",)
    assert not found.verdict.unexplained
    level = found.final.effect_parameters["coulomb_friction"]["level"]
    assert level.value == pytest.approx(1.0, abs=3.0 * level.std_error)
    assert found.noise_floor.holdout_rate_rms == pytest.approx(STEP_RAD / np.sqrt(12.0), rel=0.05)


@pytest.mark.slow
def test_a_run_of_few_steps_has_the_noise_of_the_others() -> None:
    """Its reading, of nearly nothing, had been the noise of all, and J came out a thousandth of what it is."""
    found = identify(
        read_in_steps({}, (*SETS[2:], (0.4, 2.0))), DECLARED, IdentifyConfig.model_validate({"candidates": []})
    )
    assert found.accepted
    assert found.noise_floor.holdout_rate_rms == pytest.approx(STEP_RAD / np.sqrt(12.0), rel=0.05)
    inertia = found.final.parameters["inertia"]
    assert inertia.value == pytest.approx(TRUTH[0], abs=4.0 * inertia.std_error)
    assert inertia.std_error < 1e-3 * TRUTH[0]
