"""Runs among others whose torque was recorded with the opposite sign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identify.pipeline import identify
from identify.runs.sign_consistency import describe_reversed_runs, reversed_runs
from rig.config.identify import IdentifyConfig
from rig.recording.run import Recording, Run
from tests.identify.simulated import DECLARED, SETS, TRUTH, campaign, sine_run, traces_of


def turned(run: Run) -> Run:
    assert run.torque_nm is not None
    return replace(run, torque_nm=-run.torque_nm)


def with_turned(*numbers: int, sets: Sequence[tuple[float, float]] = SETS, duration_s: float = 4.0) -> Recording:
    right = campaign(sets=sets, duration_s=duration_s)
    return replace(right, runs=tuple(turned(r) if i in numbers else r for i, r in enumerate(right.runs)))


@pytest.mark.parametrize("numbers", [(0,), (3,), (4,), (1, 3), (0, 2, 4), (1, 2, 3, 4)])
def test_the_runs_that_were_turned_are_found_even_where_they_are_the_most(numbers: tuple[int, ...]) -> None:
    found = reversed_runs(traces_of(with_turned(*numbers)))
    assert [t.number for t in found] == list(numbers)


@pytest.mark.parametrize("numbers", [(), (0, 1, 2, 3, 4)])
def test_where_all_agree_none_is_taken_out(numbers: tuple[int, ...]) -> None:
    assert reversed_runs(traces_of(with_turned(*numbers))) == []


def loaded(torque_nm: float, frequency_hz: float, added: float) -> Run:
    inertia, damping, stiffness = TRUTH
    run = sine_run(torque_nm, frequency_hz, jck=(inertia + added, damping, stiffness))
    return replace(run, name=f"{frequency_hz:g} Hz, {added:g}", added_inertia_kg_m2=added)


@pytest.mark.parametrize("number", [None, 0, 1, 3])
def test_a_mass_that_takes_a_tone_across_the_resonance_turns_no_run(number: int | None) -> None:
    sets = [(20.0, 25.0, 0.0), (20.0, 25.0, 0.02), (20.0, 35.0, 0.0), (20.0, 22.0, 0.02)]
    runs = [loaded(*each) for each in sets]
    runs = [turned(r) if i == number else r for i, r in enumerate(runs)]
    found = reversed_runs(traces_of(Recording(tuple(runs))))
    assert [t.number for t in found] == ([] if number is None else [number])


def test_a_run_whose_torque_has_nothing_to_do_with_its_motion_is_not_called_turned() -> None:
    runs = list(campaign().runs)
    torque = runs[2].torque_nm
    assert torque is not None
    runs[2] = replace(runs[2], torque_nm=100.0 * np.random.default_rng(1).standard_normal(len(torque)))
    assert reversed_runs(traces_of(replace(campaign(), runs=tuple(runs)))) == []


@pytest.mark.parametrize(
    "offered", [("coulomb_friction", "torque_delay"), pytest.param(None, marks=pytest.mark.slow)]
)  # None: the library
def test_the_rest_is_identified_without_it_and_the_result_says_so(offered: tuple[str, ...] | None) -> None:
    recording = with_turned(1, sets=SETS[2:], duration_s=1.5)
    found = identify(recording, DECLARED, IdentifyConfig(candidates=offered))
    name = recording.runs[1].name
    assert found.verdict.effects == ()
    assert found.accepted
    assert [s.name for s in found.per_set] == [r.name for i, r in enumerate(recording.runs) if i != 1]
    assert found.final.parameters["inertia"].value == pytest.approx(TRUTH[0], rel=1e-3)
    assert f"Left out: {name}" in found.holdout_note


def test_more_than_one_is_told_in_the_plural_and_none_not_at_all() -> None:
    assert describe_reversed_runs(()) == ""
    assert "those files" in describe_reversed_runs(("a.csv", "b.csv"))
