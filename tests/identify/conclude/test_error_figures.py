"""The figures that stand before and after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.conclude.error_figures import Measured, floor_of, measure
from identify.estimate.final_fit import by_output_error
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.signals.low_pass import settled
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, traces_of

JCK = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
FRICTION = {"coulomb_friction": {"level": 1.0}}
TRACES = traces_of(replace(campaign(FRICTION, sets=((104.0, 3.0), (42.0, 9.0)), duration_s=2), noise=NOISE_RAD_S))
SPLIT = split(TRACES)


def measured(*effects: str) -> Measured:
    start = dict(JCK) | {(e, "level"): 0.8 for e in effects}
    fitted = by_output_error(TRACES, Structure(effects=effects), start, 0.1, SPLIT.final, SPLIT.everything)
    return measure(TRACES, SPLIT, fitted, 100.0)


def test_with_the_hidden_friction_the_held_out_rate_error_is_the_gyros_noise() -> None:
    before, after = measured().errors, measured("coulomb_friction").errors
    assert after.holdout_rate_rms == pytest.approx(NOISE_RAD_S, rel=0.1)
    assert before.holdout_rate_rms is not None and before.holdout_rate_rms > 20 * NOISE_RAD_S
    assert after.holdout_fit_percent is not None and after.holdout_fit_percent > 99.9


def test_the_torque_figures_fall_too_and_name_their_low_pass() -> None:
    before, after = measured().errors, measured("coulomb_friction").errors
    assert before.residual_rms_torque is not None and after.residual_rms_torque is not None
    assert after.residual_rms_torque < 0.3 * before.residual_rms_torque
    assert after.lowpass_hz == 100.0
    assert after.holdout_torque_relative is not None and after.holdout_torque_relative < 0.005


def test_the_simulated_series_is_what_the_error_says() -> None:
    found = measured("coulomb_friction")
    parts = [(t.measured - y)[m] for t, y, m in zip(TRACES, found.simulated, SPLIT.judge, strict=True)]
    assert np.sqrt(np.mean(np.concatenate(parts) ** 2)) == pytest.approx(found.errors.holdout_rate_rms)


@pytest.mark.parametrize(("given", "source"), [(True, "given"), (False, "estimated")])
def test_the_floor_says_where_it_comes_from(given: bool, source: str) -> None:
    fitted = by_output_error(TRACES, Structure(), JCK, 0.1, SPLIT.final, SPLIT.everything)
    floor = floor_of(TRACES, SPLIT, fitted, 100.0, given)
    assert floor.source == source
    assert floor.holdout_rate_rms == pytest.approx(NOISE_RAD_S, rel=0.1)
    assert floor.residual_rms_torque == pytest.approx(0.01, rel=0.5), "hundredths of a newton metre"


@pytest.mark.parametrize("biased", [False, True])
def test_what_the_low_pass_does_at_the_ends_of_a_short_run_is_in_no_figure(biased: bool) -> None:
    """Runs of a platform without a spring that are cut out of its motion, thirteen edges of the filter long."""
    runs = []
    for f in (1.1, 1.9):
        time = 2e-3 * np.arange(5000)
        phase = 2 * np.pi * f * time + 0.7
        rate, acceleration = 3.0 * np.sin(phase) + 0.4 * time, 3.0 * 2 * np.pi * f * np.cos(phase) + 0.4
        angle = -3.0 / (2 * np.pi * f) * (np.cos(phase) - np.cos(0.7)) + 0.2 * time**2
        read = rate + 1e-4 * np.random.default_rng(1).standard_normal(5000)
        runs.append(
            Run(
                f"{f} Hz", time, np.ones(5000, dtype=bool), read, None if biased else angle,
                time, 2.0 * acceleration + 0.5 * rate,
            )
        )  # fmt: skip
    traces = traces_of(Recording(tuple(runs), noise=1e-4))
    parts = split(traces)
    values = {("inertia",): 2.0, ("damping",): 0.5}
    fitted = by_output_error(traces, Structure(("inertia", "damping")), values, 0.1, parts.final, parts.everything)
    found, floor = measure(traces, parts, fitted, 4.0).errors, floor_of(traces, parts, fitted, 4.0, True)
    assert found.residual_rms_torque is not None and floor.residual_rms_torque is not None
    assert found.residual_torque_relative is not None and found.residual_torque_relative < 1e-3
    assert settled(np.ones(400), 2e-3, 4.0).sum() == 200 and settled(np.ones(400), 2e-3, None).all()
