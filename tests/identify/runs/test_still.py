"""Runs in which a torque moved nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identify.pipeline import identify
from identify.runs.still import describe_still_runs, still_runs
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording
from tests.identify.simulated import DECLARED, NOISE_RAD_S, campaign, sine_run, traces_of, white

STICKY = {"coulomb_friction": {"level": 8.0}}


def test_a_run_that_friction_held_is_told_apart_from_those_that_moved() -> None:
    runs = (sine_run(60.0, 1.0, effects=STICKY), sine_run(5.0, 3.0, effects=STICKY), sine_run(60.0, 6.0))
    traces = traces_of(Recording(runs))
    found = still_runs(traces)
    assert [t.number for t in found] == [1]
    assert "3 Hz (5 N m)" in describe_still_runs(found, "rotary").replace("5.00", "5")
    assert describe_still_runs([], "rotary") == ""


def test_what_goes_along_with_the_torque_below_the_noise_has_moved() -> None:
    faint = sine_run(0.15, 3.0, noise=NOISE_RAD_S, duration_s=10.0)
    assert still_runs(traces_of(Recording((sine_run(60.0, 1.0), faint)))) == []


def test_where_nothing_moves_no_run_is_left_out() -> None:
    run = sine_run(60.0, 1.0)
    still = replace(run, rate_rad_s=white(len(run.time_s), NOISE_RAD_S))
    assert still_runs(traces_of(Recording((still, replace(still))))) == []


@pytest.mark.parametrize("effects", [None, {"coulomb_friction": {"level": 0.5}}])
def test_a_campaign_that_moves_keeps_all_its_runs(effects: dict[str, dict[str, float]] | None) -> None:
    assert still_runs(traces_of(campaign(effects))) == []


@pytest.mark.slow
def test_friction_is_named_from_the_runs_that_moved() -> None:
    """One run below break-away had spoilt the whole campaign: C thirty times too large, and nothing named."""
    sets = ((60.0, 1.0), (60.0, 3.0), (5.0, 9.0))
    runs = tuple(sine_run(m, f, effects=STICKY, seed=i) for i, (m, f) in enumerate(sets))
    settings = IdentifyConfig.model_validate({"candidates": ["coulomb_friction", "quadratic_damping"]})
    found = identify(Recording(runs), DECLARED, settings)
    assert found.verdict.effects == ("coulomb_friction",)
    assert found.accepted, found.reasons
    assert "the platform did not move: 9 Hz (5.00 N m)" in found.holdout_note
