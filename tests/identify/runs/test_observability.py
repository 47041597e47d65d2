"""What the sensors cannot show is set aside with its reason, declared or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.model.parameters import Name
from identify.pipeline import identify
from identify.runs.observability import is_as_strong_in_all, runs_last_for, why_unseen
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, campaign, decay_run, traces_of

NONE = IdentifyConfig.model_validate({"candidates": []})
TWO = ((111.0, 1.0), (67.0, 6.0))


def test_behind_a_gyro_alone_a_constant_torque_is_unseen_and_beside_an_encoder_it_is_not() -> None:
    gyro = campaign(sets=TWO, duration_s=1.0)
    both = replace(gyro, runs=tuple(replace(run, angle_rad=0.0 * run.time_s) for run in gyro.runs))
    assert "angle of rest" in why_unseen("torque_offset", traces_of(gyro))
    assert why_unseen("torque_offset", traces_of(both)) == ""


def test_where_no_torque_was_applied_no_drive_shows() -> None:
    free = traces_of(Recording((decay_run(Platform(1.0, 0.1, 40.0)),)))
    assert "no torque was applied" in why_unseen("actuator_lag", free)
    assert why_unseen("coulomb_friction", free) == ""


@pytest.mark.parametrize("declared", [{"torque_offset": {"level": 0.5}}, {"rate_bias": {"bias": 0.01}}])
def test_what_is_declared_and_unseen_is_set_aside_and_the_rest_identified(
    declared: dict[str, dict[str, float]],
) -> None:
    found = identify(campaign(sets=TWO, duration_s=1.0), Platform(*TRUTH, declared), NONE)
    assert found.accepted
    assert [item.name for item in found.final.dropped] == list(declared)
    assert found.final.parameters["inertia"].value == pytest.approx(TRUTH[0], rel=1e-3)


def test_no_candidates_means_none() -> None:
    found = identify(
        campaign({"coulomb_friction": {"level": 1.0}}, sets=TWO[1:], duration_s=1.0), Platform(*TRUTH), NONE
    )
    assert not found.verdict.candidates and found.verdict.unexplained


@pytest.mark.parametrize(("hertz", "shown"), [(0.2, False), (0.24, False), (0.26, True), (3.0, True)])
def test_what_repeats_needs_a_run_as_long_as_its_period(hertz: float, shown: bool) -> None:
    traces = traces_of(campaign(sets=TWO, duration_s=4.0))
    values = {("periodic_disturbance", "frequency"): hertz}
    assert runs_last_for("periodic_disturbance", values, traces) is shown
    assert runs_last_for("coulomb_friction", {("coulomb_friction", "level"): 1.0}, traces)


@pytest.mark.parametrize(("time_s", "shown"), [(0.1, True), (30.0, True), (50.0, False), (1e4, False)])
def test_what_relaxes_has_to_do_so_within_a_run(time_s: float, shown: bool) -> None:
    """A creep of 10,000 s is a spring from where the run began: it had taken the place of a constant torque."""
    traces = traces_of(campaign(sets=TWO, duration_s=4.0))
    assert runs_last_for("creep", {("creep", "time"): time_s}, traces) is shown


def tone(*amplitudes: float) -> dict[Name, float]:
    values: dict[Name, float] = {("inertia",): 0.02, ("periodic_disturbance", "frequency"): 9.0}
    for run, size in enumerate(amplitudes):
        values["periodic_disturbance", "sine", str(run)] = 0.6 * size
        values["periodic_disturbance", "cosine", str(run)] = -0.8 * size
    return values


@pytest.mark.parametrize(
    ("amplitudes", "error", "alike"),
    [
        ((32.2, 32.0, 32.0, 31.9), 0.2, True),
        ((1.48, 2.7, 0.2, 0.05, 0.4, 0.04), 0.1, False),  # what a drive that warms up leaves of the excitation
        ((1.0, 0.02, 1.1, 0.0), 0.01, True),  # a pump that was on in two of four runs
        ((1.0, 2.2, 0.5), 0.8, True),  # as far as the errors tell
        ((1.0,), 0.01, True),
    ],
)
def test_a_source_in_the_surroundings_is_as_strong_in_every_run_that_has_it(
    amplitudes: tuple[float, ...], error: float, alike: bool
) -> None:
    assert is_as_strong_in_all("periodic_disturbance", tone(*amplitudes), lambda name: error / np.sqrt(2.0)) is alike
    assert is_as_strong_in_all("coulomb_friction", tone(*amplitudes), lambda name: 0.0)
