"""What a candidate is expected to take of the residual, before it is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

from identify.estimate.initial_guess import scale_of
from identify.estimate.output_error import Estimate, refine
from identify.model.structure import Structure
from identify.propose.score_test import Scores, _bounded
from rig import effects
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, campaign, traces_of, white

START = {("inertia",): 0.0201, ("damping",): 0.05, ("stiffness",): 676.0}
CANDIDATES = [n for n in effects.names() if n not in ("rate_bias", "torque_offset", "periodic_disturbance")]
HIDDEN: dict[str, Mapping[str, float]] = {
    "coulomb_friction": {"level": 0.1},
    "cubic_stiffness": {"factor": 20.0},
    "torque_delay": {"delay": 1e-4},
    "creep": {"stiffness": 1.0, "time": 0.2},
    "stiffness_drift": {"slope": 0.5},
    "directional_damping": {"step": 0.006},
}


@cache
def fitted(name: str) -> Estimate:
    traces = traces_of(campaign({name: HIDDEN[name]} if name else None, duration_s=4))
    return refine(traces, Structure(), START, None, 15, coarse=True)


def scores_of(name: str) -> Scores:
    estimate = fitted(name)
    scale = scale_of([s.trace for s in estimate.shots], TRUTH, ())
    return Scores(estimate, (), NOISE_RAD_S, scale)


@pytest.mark.parametrize("name", HIDDEN)
def test_the_hidden_effect_promises_the_most_or_what_contains_it_does(name: str) -> None:
    looks = scores_of(name).all(CANDIDATES)
    mine = next(s.gain for s in looks if s.effect == name)
    assert mine > 0.95 * looks[0].gain or name in effects.get(looks[0].effect).nests


@pytest.mark.parametrize("name", ["cubic_stiffness", "creep", "directional_damping"])
def test_a_fit_from_where_the_score_points_gains_what_it_promised(name: str) -> None:
    estimate = fitted(name)
    look = next(s for s in scores_of(name).all([name]))
    start = {**dict(zip(estimate.names, estimate.values.tolist(), strict=True)), **look.start}
    better = refine([s.trace for s in estimate.shots], Structure(effects=(name,)), start, None, 15, coarse=True)
    fall = (estimate.sigma**2 - better.sigma**2) * estimate.count / NOISE_RAD_S**2
    assert fall == pytest.approx(look.gain, rel=0.35)
    assert better.sigma < 1.05 * NOISE_RAD_S


def test_where_nothing_is_hidden_nothing_promises_more_than_chance() -> None:
    looks = scores_of("").all(CANDIDATES)
    assert max(s.gain for s in looks) < 20.0


def test_a_part_from_the_middle_of_a_run_promises_nothing_where_the_gyros_lag_is_in_the_model() -> None:
    time, quiet, lag = np.arange(6001) * 1e-3, np.radians(0.01), {"sensor_lag": {"time": 0.0025}}
    torque = TorqueSignal(time, 60.0 * np.clip(time / 4.0, 0.0, 1.0) * np.sin(2 * np.pi * 6.0 * time))
    rate = simulate(Platform(*TRUTH, lag), time, torque, substeps=16).sensed_rate_rad_s + white(len(time), quiet)
    ones, asked = np.ones(len(time), bool), torque.torque_nm
    run = Run("soft", time, ones, rate_rad_s=rate, torque_time_s=time, torque_nm=asked, frequency_hz=6.0)
    start = dict(zip(START, TRUTH, strict=True)) | {("sensor_lag", "time"): 0.0025}
    traces = traces_of(Recording((run,)))
    estimate = refine(traces, Structure(effects=("sensor_lag",)), start, None, 15, coarse=True)
    scores = Scores(estimate, (), quiet, scale_of(traces, TRUTH, ()), share=0.3)
    assert len(scores.runs[0].base) < 0.4 * len(time)
    assert max(s.gain for s in scores.all(["actuator_lag", "torque_delay", "creep", "cubic_stiffness"])) < 20.0


def test_a_gain_that_may_not_turn_its_sign_promises_nothing_where_it_would_have_to() -> None:
    square, lowest = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([0.0, -np.inf])
    x, fall = _bounded(square, np.array([-1.0, 0.3]), lowest)
    assert x[0] == 0.0
    assert x[1] == pytest.approx(0.3)
    assert fall == pytest.approx(0.09)
    assert _bounded(square[:1, :1], np.array([-1.0]), lowest[:1])[1] == 0.0


def test_a_pull_at_rest_is_no_push_where_friction_holds_the_platform() -> None:
    """Within a few degrees gravity beside the axis is a quadratic spring and a shift of the rest angle."""
    hidden = {"coulomb_friction": {"level": 0.5}, "unbalance": {"sine": 0.0, "cosine": 2.0}}
    traces = traces_of(campaign(hidden, sets=((100.0, 1.0), (42.0, 9.0)), duration_s=3))
    known = {("coulomb_friction", "level"): 0.5}
    estimate = refine(traces, Structure(effects=("coulomb_friction",)), {**START, **known}, None, 15, coarse=True)
    looks = Scores(estimate, (), NOISE_RAD_S, scale_of(traces, TRUTH, ())).all(["unbalance", "quadratic_stiffness"])
    gains = {s.effect: s.gain for s in looks}
    assert gains["quadratic_stiffness"] > 100.0
    assert gains["unbalance"] > 0.9 * gains["quadratic_stiffness"]
