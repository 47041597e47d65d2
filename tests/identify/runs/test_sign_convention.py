"""Torque and rate recorded with opposite signs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.results import RunTraces
from identify.runs.sign_convention import signs
from tests.identify.sample import sample
from tests.identify.simulated import white

TRACES = sample(2.0)[0].traces


def turned(trace: RunTraces) -> RunTraces:
    assert trace.torque_nm is not None
    return replace(trace, torque_nm=-trace.torque_nm)


@pytest.mark.parametrize("cutoff_hz", [10.0, 50.0, 120.0])
def test_a_platform_that_seems_to_turn_against_the_torque_has_opposite_signs(cutoff_hz: float) -> None:
    right, wrong = signs(TRACES, cutoff_hz), signs([turned(t) for t in TRACES], cutoff_hz)
    assert right is not None
    assert wrong is not None
    assert not right.opposite
    assert wrong.opposite
    assert wrong.stiffness == pytest.approx(-right.stiffness, rel=1e-6)


@pytest.mark.parametrize("number", range(5))
def test_each_set_alone_shows_it(number: int) -> None:
    right, wrong = signs([TRACES[number]], 50.0), signs([turned(TRACES[number])], 50.0)
    assert right is not None
    assert wrong is not None
    assert (right.opposite, wrong.opposite) == (False, True)


def test_a_late_torque_bends_damping_and_leaves_the_sign_alone() -> None:
    late = [replace(t, torque_nm=np.roll(t.torque_nm, -3)) for t in TRACES if t.torque_nm is not None]
    found = signs(late, 50.0)
    assert found is not None
    assert not found.opposite


def test_a_free_mass_shows_it_by_its_inertia() -> None:
    time = np.arange(4001) * 1e-3
    rate = np.sin(2 * np.pi * 2.0 * time) + 0.3 * np.sin(2 * np.pi * 5.0 * time)
    angle = np.cumsum(rate) * 1e-3
    torque = -(0.02 * np.gradient(rate, 1e-3) + 0.01 * rate) + white(len(time), 0.01)
    trace = replace(TRACES[0], time_s=time, rate_rad_s=rate, angle_rad=angle, torque_nm=torque, keep=np.ones(4001))
    found = signs([trace], 50.0)
    assert found is not None
    assert found.inertia < -4.0
    assert found.opposite


def test_a_torque_that_has_nothing_to_do_with_the_motion_has_no_sign() -> None:
    stray = [replace(t, torque_nm=white(len(t.time_s), 50.0, i)) for i, t in enumerate(TRACES)]
    found = signs(stray, 50.0)
    assert found is not None
    assert not found.opposite


def test_without_torque_there_is_no_sign() -> None:
    assert signs([replace(t, torque_nm=None) for t in TRACES], 50.0) is None
    assert signs([replace(t, torque_nm=np.zeros(len(t.time_s))) for t in TRACES], 50.0) is None
