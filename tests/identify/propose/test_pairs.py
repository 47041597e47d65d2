"""Two effects that hide each other are found at once, and nothing is paired where one effect says it all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.initial_guess import first_guess, scale_of
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.propose.pairs import pairs
from identify.runs.holdout import split
from identify.select.candidates import Candidates
from identify.signals.prepare import prepare
from rig import effects
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.effects.base import Place
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import DECLARED, NOISE_RAD_S, SETS, TRUTH, sine_run

GAP_AND_DEAD_ZONE = {"torque_deadzone": {"width": 1.1}, "backlash": {"half_gap": 0.0016}}
NAMES = [n for n in effects.known() if effects.get(n).place is not Place.SENSOR and not effects.get(n).resembles_much]


def recording(given: dict[str, dict[str, float]]) -> Recording:
    runs = []
    for i, (torque_nm, frequency_hz) in enumerate(SETS):
        run = sine_run(torque_nm, frequency_hz)
        assert run.torque_nm is not None
        torque = TorqueSignal(run.time_s, run.torque_nm)
        rate = simulate(Platform(*TRUTH, given), run.time_s, torque, substeps=16).sensed_rate_rad_s
        runs.append(replace(run, rate_rad_s=rate + NOISE_RAD_S * np.random.default_rng(i).standard_normal(len(rate))))
    return Recording(tuple(runs))


def test_a_gap_and_a_dead_zone_that_cancel_are_the_pair_that_takes_most_away() -> None:
    traces = [prepare(run, i) for i, run in enumerate(recording(GAP_AND_DEAD_ZONE).runs)]
    start = replace(first_guess(traces, Structure()), platform=TRUTH)
    found = pairs(traces, Structure(), {}, start, scale_of(traces, TRUTH, ()), [n for n in NAMES if n != "rate_bias"])
    assert {"torque_deadzone", "backlash"} in [set(pair.names) for pair in found]
    [pair] = [p for p in found if set(p.names) == {"torque_deadzone", "backlash"}]
    own = {(t,) for t in ("inertia", "damping", "stiffness")}
    assert pair.start.keys() - own == {("torque_deadzone", "width"), ("backlash", "half_gap")}
    assert 0.3 < pair.start[("torque_deadzone", "width")] / 1.1 < 3.0


def test_values_to_begin_from_are_those_of_the_regression() -> None:
    given = {"cubic_stiffness": {"factor": 300.0}, "quadratic_damping": {"factor": 0.05}}
    traces = [prepare(run, i) for i, run in enumerate(recording(given).runs)]
    start = replace(first_guess(traces, Structure()), platform=TRUTH)
    found = pairs(traces, Structure(), {}, start, scale_of(traces, TRUTH, ()), ["cubic_stiffness", "quadratic_damping"])
    assert found
    assert abs(found[0].start[("cubic_stiffness", "factor")] / 300.0 - 1.0) < 0.05
    assert abs(found[0].start[("quadratic_damping", "factor")] / 0.05 - 1.0) < 0.1
    assert found[0].start[("stiffness",)] == pytest.approx(TRUTH[2], rel=1e-3)
    assert found[0].start[("damping",)] == pytest.approx(TRUTH[1], rel=0.1)


def test_a_tone_beside_a_spring_is_a_pair_of_those_that_can_follow_anything() -> None:
    given = {
        "periodic_disturbance": {"sine": 4.0, "cosine": 1.0, "frequency": 31.0}, "cubic_stiffness": {"factor": 900.0},
    }  # fmt: skip
    traces = [prepare(run, i) for i, run in enumerate(recording(given).runs)]
    start = replace(first_guess(traces, Structure()), platform=TRUTH)
    names = ["coulomb_friction", "cubic_stiffness", "quadratic_damping", "periodic_disturbance"]
    found = pairs(traces, Structure(), {}, start, scale_of(traces, TRUTH, (31.0,)), names)
    assert {"cubic_stiffness", "periodic_disturbance"} in [set(p.names) for p in found]
    pliant = ["periodic_disturbance" in p.names for p in found]
    assert pliant == sorted(pliant)  # plain pairs are tried first


def test_what_has_a_shape_for_everything_is_sought_alone() -> None:
    given = {"cubic_stiffness": {"factor": 900.0}, "quadratic_damping": {"factor": 0.2}}
    traces = [prepare(run, i) for i, run in enumerate(recording(given).runs)]
    offer = Candidates(traces, split(traces), ("cogging", "coulomb_friction", *given))
    jck = dict(zip((("inertia",), ("damping",), ("stiffness",)), TRUTH, strict=True))
    now = offer.fits.whole(Structure(), jck)
    assert now is not None
    found = [set(pair.names) for pair in offer.pairs(now)]
    assert set(given) in found
    assert not any("cogging" in names for names in found)


def test_a_gap_between_the_points_of_the_grid_is_put_beside_the_others_at_its_best_shape() -> None:
    given = {"backlash": {"half_gap": 6e-4}, "quadratic_damping": {"factor": 0.1}}
    traces = [prepare(run, i) for i, run in enumerate(recording(given).runs)]
    start = replace(first_guess(traces, Structure()), platform=TRUTH)
    asked: list[str] = []

    def best_shape(name: str) -> tuple[float, ...]:
        asked.append(name)
        return (6e-4,)

    names = ["backlash", "quadratic_damping"]
    found = pairs(traces, Structure(), {}, start, scale_of(traces, TRUTH, ()), names, best_shape)
    assert asked == ["backlash"]
    assert found
    assert found[0].start[("backlash", "half_gap")] == 6e-4


@pytest.mark.slow
def test_a_model_that_has_effects_of_the_drive_already_is_looked_at_too() -> None:
    given = {"torque_delay": {"delay": 3e-4}, **GAP_AND_DEAD_ZONE}
    made = recording(given)
    settings = IdentifyConfig.model_validate({"candidates": ["coulomb_friction", "torque_deadzone", "backlash"]})
    declared = replace(DECLARED, effects={"torque_delay": {"delay": 0.0}})
    found = identify(made, declared, settings)
    assert set(found.verdict.effects) == {"torque_deadzone", "backlash"}
    assert found.final.effect_parameters["torque_deadzone"]["width"].value == pytest.approx(1.1, rel=0.01)
    assert found.final.effect_parameters["backlash"]["half_gap"].value == pytest.approx(0.0016, rel=0.01)


@pytest.mark.slow
def test_two_large_effects_that_can_follow_anything_are_both_named() -> None:
    given = {
        "creep": {"stiffness": 110.0, "time": 0.02},
        "periodic_disturbance": {"sine": 4.0, "cosine": 0.0, "frequency": 38.0},
    }
    settings = IdentifyConfig.model_validate({"candidates": ["creep", "periodic_disturbance", "actuator_lag"]})
    found = identify(recording(given), DECLARED, settings)
    assert set(found.verdict.effects) == {"creep", "periodic_disturbance"}
    assert abs(found.final.effect_parameters["creep"]["time"].value / 0.02 - 1.0) < 0.01
