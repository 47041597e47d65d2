"""The loop over structures: what is added, in which order, what is dropped and when it stops."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from identify.estimate.cross_validation import horizon_s
from identify.estimate.initial_guess import first_guess
from identify.model.structure import Structure
from identify.runs.holdout import pieces, split
from identify.select.search_state import Search
from identify.select.short_horizon_search import Loop
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, campaign, traces_of, white
from tests.rig.effects.values import VALUES

FEW = ("coulomb_friction", "cubic_stiffness", "quadratic_damping", "torque_delay", "backlash")


def searched(recording: Recording, candidates: Sequence[str] = FEW) -> Search:
    traces = traces_of(recording)
    found = split(traces)
    start = first_guess(traces, Structure())
    shortest = 3.0 * horizon_s(start.platform, traces)
    fitting, judging = pieces(traces, found.fit, shortest), pieces(traces, found.judge, shortest, 5000)
    return Loop(fitting, judging, start, candidates, lambda text: None, traces).run(Structure(), {})


@cache
def hidden(*names: str) -> Search:
    return searched(campaign({n: VALUES[n] for n in names}, duration_s=4.0))


def test_where_nothing_is_hidden_nothing_is_added_and_nothing_is_dropped() -> None:
    found = hidden()
    assert found.best.structure == Structure()
    assert not found.dropped
    assert found.best.sigma == pytest.approx(found.floor, rel=0.05)


@pytest.mark.parametrize("name", ["coulomb_friction", "cubic_stiffness", "quadratic_damping", "torque_delay"])
def test_one_hidden_effect_is_added_and_then_the_loop_stops_at_the_noise(name: str) -> None:
    found = hidden(name)
    assert found.best.structure.effects == (name,)
    assert found.best.sigma < 1.1 * found.floor
    (parameter, value) = next(iter(VALUES[name].items()))
    assert found.best.values()[name, parameter] == pytest.approx(value, rel=0.02)


def test_two_hidden_effects_are_both_added() -> None:
    found = hidden("coulomb_friction", "torque_delay")
    assert set(found.best.structure.effects) == {"coulomb_friction", "torque_delay"}
    assert found.best.sigma < 1.1 * found.floor


def test_every_candidate_stands_in_the_table_with_its_round_and_its_fate() -> None:
    found = hidden("coulomb_friction")
    first = {c.effect: c for c in found.candidates if c.round == 1}
    assert set(first) == set(FEW)
    assert first["coulomb_friction"].status == "added"
    assert first["coulomb_friction"].delta_bic < -1000
    assert all(c.status for c in found.candidates)


def test_an_effect_that_may_not_be_tried_is_not_named() -> None:
    recording = campaign({"coulomb_friction": {"level": 1.0}}, duration_s=2.0)
    assert searched(recording, ("quadratic_damping",)).best.structure.effects in ((), ("quadratic_damping",))


def test_a_constant_torque_is_no_candidate_where_a_gyro_alone_cannot_see_it() -> None:
    found = searched(campaign({"torque_offset": {"level": 1.0}}, duration_s=2.0), (*FEW, "torque_offset"))
    assert "torque_offset" not in {c.effect for c in found.candidates}
    assert found.best.structure.effects == ()


def free_axis(offset_nm: float = 0.0) -> Recording:
    """An axis without a spring under a torque that swings it to and fro, read by an encoder."""
    from rig.dynamics import TorqueSignal, simulate  # noqa: PLC0415

    effects = {"coulomb_friction": {"level": 0.05}} | ({"torque_offset": {"level": offset_nm}} if offset_nm else {})
    time = np.arange(8001) * 1e-3
    torque = TorqueSignal(time, 0.4 * np.sin(2 * np.pi * 1.0 * time) + 0.3 * np.sin(2 * np.pi * 2.7 * time + 1.0))
    runs = []
    for seed in range(3):
        angle = simulate(Platform(0.01, 0.02, 0.0, effects), time, torque, substeps=4).angle_rad
        noisy = angle + white(len(time), 2e-5, seed)
        ok = np.ones(len(time), bool)
        runs.append(Run(f"run {seed}", time, ok, angle_rad=noisy, torque_time_s=time, torque_nm=torque.torque_nm))
    return Recording(tuple(runs))


def test_on_an_axis_without_a_spring_no_stiffness_is_left_to_soak_something_up() -> None:
    found = searched(free_axis(0.02), ("coulomb_friction", "torque_offset", "quadratic_damping"))
    assert "stiffness" not in found.best.structure.terms
    assert dict(found.dropped)["stiffness"]
    assert set(found.best.structure.effects) == {"coulomb_friction", "torque_offset"}
    assert found.best.values()["torque_offset", "level"] == pytest.approx(0.02, rel=0.05)


def test_the_floor_is_the_sensors_noise() -> None:
    assert hidden().floor == pytest.approx(NOISE_RAD_S, rel=0.05)
