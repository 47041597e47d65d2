"""What stands in model.yaml where the data say nothing, from a recording to the file."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import yaml

from identify.pipeline import identify
from identify.report.files import final_platform, model_text
from identify.results import Identification
from rig.config.identify import IdentifyConfig
from rig.config.model import ModelConfig
from rig.config.simulated import SimulatedConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run
from tests.identify.simulated import decay_run, white

FEW = IdentifyConfig.model_validate({"candidates": ("coulomb_friction", "torque_delay")})
SMALL = (0.02, 0.1, 20.0)
TONE_RAD_S = 2.0 * np.pi
DECLARED = Platform(0.05, 0.3, 33.0)


def a_tone() -> tuple[Array, TorqueSignal]:
    time = np.arange(5001) * 5e-3
    ramp = np.clip(time / 8.0, 0.0, 1.0)
    return time, TorqueSignal(time, np.sin(TONE_RAD_S * time) * ramp**2 * (3.0 - 2.0 * ramp))


def moved_by_it(platform: Platform) -> Array:
    time, torque = a_tone()
    return np.asarray(simulate(platform, time, torque, substeps=8).rate_rad_s)


@cache
def one_steady_sine() -> Identification:
    """Without its start: it tells K - J w^2 and C, and neither J nor K."""
    time, torque = a_tone()
    rate = moved_by_it(Platform(*SMALL)) + white(len(time), 0.002)
    late = time >= 12.0
    run = Run("sine", time[late], np.ones(int(late.sum()), bool), rate_rad_s=rate[late], torque_time_s=time,
              torque_nm=torque.torque_nm, frequency_hz=1.0)  # fmt: skip
    return identify(Recording((run,)), DECLARED, FEW)


def written(found: Identification, declared: Platform, inertia_declared: bool = True) -> tuple[str, ModelConfig]:
    """The text of model.yaml, and what it declares when it is put back; the simulated backend takes it, too."""
    text = model_text(found, declared, inertia_declared)
    SimulatedConfig.model_validate({"platform": yaml.safe_load(text)})
    return text, ModelConfig.model_validate(yaml.safe_load(text))


def test_what_the_file_says_is_kept_as_declared_is_the_declared_number() -> None:
    text, model = written(one_steady_sine(), DECLARED)
    assert {lost.name for lost in one_steady_sine().final.not_determined} == {"inertia", "stiffness"}
    assert "# Not determined, kept as declared: inertia:" in text
    assert model.inertia_kg_m2 == DECLARED.inertia_kg_m2


def test_what_contradicts_the_runs_is_fitted_beside_it_and_the_file_says_that() -> None:
    text, model = written(one_steady_sine(), DECLARED)
    assert "# Not determined, NOT as declared" in text
    assert "stiffness" in next(line for line in text.splitlines() if "NOT as declared" in line)
    measured = SMALL[2] - SMALL[0] * TONE_RAD_S**2
    assert model.stiffness_nm_rad - model.inertia_kg_m2 * TONE_RAD_S**2 == pytest.approx(measured, rel=1e-3)


def test_the_twin_moves_as_the_rig_was_measured_to() -> None:
    twin, rig = moved_by_it(written(one_steady_sine(), DECLARED)[1].platform()), moved_by_it(Platform(*SMALL))
    late = a_tone()[0] >= 12.0
    assert np.sqrt(np.mean((twin - rig)[late] ** 2)) < 5e-4  # a quarter of the gyro's noise


LIGHT = Platform(0.0057, 0.001, 0.24, effects={"coulomb_friction": {"level": 3e-4}})


@cache
def a_decay() -> Identification:
    return identify(Recording((decay_run(LIGHT, 0.5, 15.0),)), Platform(0.0057, 0.002, 0.3), FEW)


@pytest.mark.slow
def test_without_torque_all_that_is_a_torque_is_scaled_by_the_declared_inertia() -> None:
    assert a_decay().verdict.effects == ("coulomb_friction",)
    text, model = written(a_decay(), Platform(0.0057, 0.002, 0.3))
    assert "the declared inertia sets the scale" in text
    assert model.inertia_kg_m2 == 0.0057
    assert model.stiffness_nm_rad == pytest.approx(LIGHT.stiffness_nm_rad, rel=1e-3)
    assert model.damping_nm_s_rad == pytest.approx(LIGHT.damping_nm_s_rad, rel=0.05)
    assert model.platform().effects["coulomb_friction"]["level"] == pytest.approx(3e-4, rel=0.05)


def test_where_no_inertia_was_declared_the_file_says_that_only_ratios_are_known() -> None:
    text, model = written(a_decay(), Platform(), inertia_declared=False)
    assert "# ONLY RATIOS TO THE INERTIA ARE KNOWN" in text
    assert model.inertia_unknown
    assert not model.inertia_declared
    assert model.stiffness_nm_rad / model.inertia_kg_m2 == pytest.approx(0.24 / 0.0057, rel=1e-3)


def test_a_twin_of_a_decay_decays_alike_with_any_inertia() -> None:
    time = np.arange(1001) * 5e-3
    twins = [
        simulate(final_platform(a_decay(), Platform(j), known), time, None, start=(0.5, 0.0), substeps=8).angle_rad
        for j, known in ((0.0057, True), (3.0, True), (0.02, False))
    ]
    assert np.allclose(twins[0], twins[1], atol=1e-9)
    assert np.allclose(twins[0], twins[2], atol=1e-9)
