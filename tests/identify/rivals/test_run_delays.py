"""Runs whose torque and rate were stamped by clocks that agree a little worse in every run."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identify.estimate.final_fit import by_output_error
from identify.estimate.own_delays import DELAY_NAME, beside_own_delay
from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.rivals.run_delays import Aligned, aligned, told
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Run

PLATFORM = Platform(0.02, 0.045, 680.0)
STEP_S, COUNT, SIGMA = 1e-3, 4000, 9e-4
FREQUENCIES_HZ = (3.0, 6.0, 9.0, 14.0)
LATE_S = (-4e-6, 1e-6, 5e-6, -2e-6)
NONE_S = (0.0, 0.0, 0.0, 0.0)
STRUCTURE = Structure(effects=("torque_delay",))
START = {("inertia",): 0.02, ("damping",): 0.045, ("stiffness",): 680.0, DELAY_NAME: 1e-4}


@cache
def recorded(late_s: tuple[float, ...], other_clock: bool = True, changing_s: float = 0.0) -> tuple[list[Trace], Fit]:
    """Runs whose torque acts so much later than it was stamped, each shaken at one frequency; one delay fitted to all.

    ``changing_s``: by how much later yet at the end of every run than in its middle, and earlier where it begins.
    """
    rng = np.random.default_rng(3)
    time = STEP_S * np.arange(COUNT)
    stamps = time - 0.4 * STEP_S if other_clock else time
    out = []
    for i, (hz, late) in enumerate(zip(FREQUENCIES_HZ, late_s, strict=True)):
        torque = 60.0 * np.sin(2.0 * np.pi * hz * stamps)
        drifting_s = changing_s * np.linspace(-1.0, 1.0, COUNT)
        acting = TorqueSignal(stamps + 1e-4 + late + drifting_s, torque, "zero_order")
        rate = simulate(PLATFORM, time, acting).rate_rad_s + SIGMA * rng.standard_normal(COUNT)
        run = Run(
            str(hz), time, np.ones(COUNT, dtype=bool), rate_rad_s=rate, torque_time_s=stamps, torque_nm=torque,
            torque_hold="zero_order", frequency_hz=hz,
        )  # fmt: skip
        out.append(prepare(run, i, SIGMA))
    return out, PredictionError(out).fit(STRUCTURE, START)


@cache
def moved() -> tuple[list[Trace], list[Trace]]:
    """The runs that are late, as they were recorded and as they were moved."""
    traces, best = recorded(LATE_S)
    found = aligned(traces, [t.keep for t in traces], best)
    assert found is not None
    return traces, found.traces


def offsets_of(traces: list[Trace]) -> Array:
    """By how much every torque was moved from its stamps, in s."""
    both = [(t.torque, t.run.torque_time_s) for t in traces]
    return np.array([float(np.mean(t.time_s - given)) for t, given in both if t is not None and given is not None])


def test_every_run_is_moved_to_the_delay_that_it_shows() -> None:
    traces, found = moved()
    assert re.search(r"by up to [67](\.\d)? us", told(traces, found))
    offsets = offsets_of(found)
    assert offsets - offsets[-1] == pytest.approx(np.array(LATE_S) - LATE_S[-1], abs=1e-6)


def test_runs_that_were_moved_tell_far_more_and_nothing_false() -> None:
    traces, found = moved()
    use = [t.keep for t in traces]
    after, before = (by_output_error(ts, STRUCTURE, START, 1.0, use, use) for ts in (found, traces))
    for name, truth in ((("inertia",), 0.02), (("damping",), 0.045), (("stiffness",), 680.0)):
        assert abs(after.values[name] - truth) < 3.0 * after.std_error(name)
    assert after.std_error(("inertia",)) < 0.3 * before.std_error(("inertia",))


def test_a_clock_that_runs_a_little_faster_is_followed_along_the_run() -> None:
    traces, best = recorded(NONE_S, changing_s=4e-6)
    use = [t.keep for t in traces]
    found = aligned(traces, use, best)
    assert found is not None
    for trace in found.traces[1:]:  # the first tells its delay to several us only
        assert trace.torque is not None and trace.run.torque_time_s is not None
        moved_s = trace.torque.time_s - trace.run.torque_time_s
        assert 0.5 * (moved_s[-1] - moved_s[0]) == pytest.approx(4e-6, abs=1.5e-6)
    after = by_output_error(found.traces, STRUCTURE, START, 1.0, use, use)
    for name, truth in ((("inertia",), 0.02), (("damping",), 0.045), (("stiffness",), 680.0)):
        assert abs(after.values[name] - truth) < 3.0 * after.std_error(name)


@pytest.mark.parametrize("other_clock", [True, False])
def test_runs_that_agree_or_have_one_clock_are_not_moved(other_clock: bool) -> None:
    traces, best = recorded(NONE_S if other_clock else LATE_S, other_clock)
    assert aligned(traces, [t.keep for t in traces], best) is None


def test_without_a_delay_in_the_model_nothing_is_moved() -> None:
    traces, _ = recorded(LATE_S)
    values = {n: v for n, v in START.items() if n != DELAY_NAME}
    best = PredictionError(traces).fit(Structure(), values, iterations=0, thorough=False)
    assert aligned(traces, [t.keep for t in traces], best) is None
    single = [replace(traces[0], number=0)]
    alone = PredictionError(single).fit(STRUCTURE, START, iterations=0, thorough=False)
    assert aligned(single, [single[0].keep], alone) is None


def test_what_a_run_tells_of_the_rest_is_what_its_own_delay_cannot_follow() -> None:
    columns = np.random.default_rng(0).standard_normal((50, 3))
    names = (("inertia",), DELAY_NAME, ("damping",))
    along = np.linspace(-1.0, 1.0, 50)
    left = beside_own_delay(columns, names, along)
    assert left[:, 1] == pytest.approx(columns[:, 1])
    assert left[:, [0, 2]].T @ columns[:, 1] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert left[:, [0, 2]].T @ (along * columns[:, 1]) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_only_a_name_that_brings_about_as_little_as_the_clocks_may_be_theirs() -> None:
    def search(*costs: float) -> Any:
        before = [SimpleNamespace(now=SimpleNamespace(cost=c), added=("an effect",)) for c in costs[:-1]]
        return SimpleNamespace(rounds=before, best=SimpleNamespace(cost=costs[-1], count=1000))

    clocks = Aligned([], 0.05)  # 50 on the samples that were searched
    assert not clocks.may_explain(search(0.0, -1000.0))
    assert clocks.may_explain(search(0.0, -1000.0, -1100.0))
    assert not clocks.may_explain(search(0.0))
