"""A gyro beyond its full scale is recognised by what it cuts off, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from identify.runs.clipping import describe, full_scale_of
from rig.config.identify import IdentifyConfig
from rig.platform import TERMS
from rig.recording.run import Array, Recording
from tests.identify.simulated import DECLARED, TRUTH, campaign

TIME = np.arange(4000) * 1e-3
NONE = (-np.inf, np.inf)


def swing(peak: float, hertz: float, noise: float = 0.0, resolution: float = 0.0) -> Array:
    rate = peak * np.sin(2 * np.pi * hertz * TIME) + noise * np.random.default_rng(1).standard_normal(len(TIME))
    return resolution * np.round(rate / resolution) if resolution else rate


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("resolution", [0.0, 0.1])
def test_what_a_full_scale_cuts_off_tells_it(noise: float, resolution: float) -> None:
    cut = np.clip(swing(450.0, 3.0, noise, resolution), -400.0, 400.0)
    assert full_scale_of([swing(350.0, 1.0, noise, resolution), cut]) == (-400.0, 400.0)


def test_one_side_may_be_cut_off_alone() -> None:
    assert full_scale_of([np.minimum(swing(350.0, 3.0) + 100.0, 400.0)]) == (-np.inf, 400.0)


@pytest.mark.parametrize("hertz", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("resolution", [0.0, 0.01, 1.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.4])
def test_the_top_of_a_swing_in_coarse_steps_is_not_cut_off(hertz: float, resolution: float, noise: float) -> None:
    assert full_scale_of([swing(200.0, hertz, noise, resolution)]) == NONE


@pytest.mark.parametrize("rate", [np.zeros(4000), np.clip(200.0 * TIME, 0.0, 400.0), np.zeros(0), np.ones(2)])
def test_a_platform_at_rest_or_one_that_reaches_a_constant_rate_once_tells_none(rate: Array) -> None:
    assert full_scale_of([rate]) == NONE


def test_it_is_told_in_which_runs() -> None:
    said = describe([("a", 12, np.radians(400.0)), ("b", 0, 0.0)], "rotary")
    assert said.endswith("the platform moved faster: a (12 samples at 400 deg/s)")
    assert describe([("a", 12, 1.5)], "linear").endswith("a (12 samples at 1.5 m/s)")
    assert describe([("b", 0, 0.0)], "rotary") == ""


@pytest.mark.slow
def test_what_is_cut_off_bends_no_parameter_and_nothing_is_named_for_it() -> None:
    whole = campaign(duration_s=2.0)
    highest = max(float(np.max(np.abs(run.rate_rad_s))) for run in whole.runs if run.rate_rad_s is not None)
    limit = 0.8 * highest
    runs = [
        replace(run, rate_rad_s=np.clip(run.rate_rad_s, -limit, limit)) for run in whole.runs
        if run.rate_rad_s is not None
    ]  # fmt: skip
    settings = IdentifyConfig.model_validate({"candidates": ["coulomb_friction", "cubic_stiffness"]})
    found = identify(Recording(tuple(runs)), DECLARED, settings)
    assert found.accepted and not found.verdict.effects
    for name, true in zip(TERMS, TRUTH, strict=True):
        assert found.before.parameters[name].value == pytest.approx(true, rel=3e-4)
    assert "Samples at the sensor's full scale are excluded" in found.holdout_note
