"""Inertia that hardly shows: what the runs' rest and the valley of the squares make of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit, by_output_error
from identify.estimate.output_error import OutputErrorFit, refine
from identify.estimate.profile_likelihood import settled
from identify.estimate.started_at_rest import depends_on_ringing, with_fixed_initial_state
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run

LOUD = 2.0 * NOISE_RAD_S
INERTIA = ("inertia",)


def slow(seed: int, begin_rad: float = 0.0) -> list[Trace]:
    """Two soft sines far below the resonance at 29 Hz."""
    return [
        prepare(sine_run(85.0, f, duration_s=6.0, soft_s=1.0, seed=seed, noise=LOUD, begin_rad=begin_rad))
        for f in (0.5, 1.0)
    ]


def fitted(traces: Sequence[Trace], inertia: float) -> FinalFit:
    start = {INERTIA: inertia, ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
    use = [t.keep for t in traces]
    return by_output_error(traces, Structure(), start, 0.1, use, use)


@pytest.mark.slow
@pytest.mark.parametrize("begun", [0.5, 2.0])
def test_an_inertia_that_shows_in_rings_of_noise_comes_out_within_its_interval(begun: float) -> None:
    off = []
    for seed in range(5):
        found = fitted(slow(seed), begun * TRUTH[0])
        error = found.std_error(INERTIA)
        assert 0.05 * TRUTH[0] < error < 0.15 * TRUTH[0]
        off.append((found.values[INERTIA] - TRUTH[0]) / error)
    assert max(abs(x) for x in off) < 3.0
    assert float(np.sqrt(np.mean(np.square(off)))) < 1.7


def test_stiffness_moves_with_an_inertia_that_is_hardly_known() -> None:
    found = fitted(slow(3), TRUTH[0])
    i, k = (found.names.index((term,)) for term in ("inertia", "stiffness"))
    assert found.covariance[i, k] > 0.9 * found.std_error(INERTIA) * found.std_error(("stiffness",))
    assert found.values[("stiffness",)] == pytest.approx(TRUTH[2], abs=3.0 * found.std_error(("stiffness",)))


def test_runs_that_ring_by_themselves_tell_the_inertia_and_are_not_held_to_rest() -> None:
    traces = slow(0, begin_rad=0.01)
    found = fitted(traces, 1.2 * TRUTH[0])
    assert found.values[INERTIA] == pytest.approx(TRUTH[0], rel=1e-3)
    assert found.free_run is not None
    assert not any(s.rests for s in found.free_run.shots)


def in_motion(seed: int) -> list[Trace]:
    """The same, cut at two seconds and a bit: nothing is at rest there."""
    out = []
    for i, f in enumerate((0.5, 1.0)):
        run = sine_run(85.0, f, duration_s=8.3, soft_s=1.0, seed=seed, noise=LOUD)
        late = slice(2300, None)
        assert run.rate_rad_s is not None
        out.append(
            prepare(replace(run, time_s=run.time_s[late], valid=run.valid[late], rate_rad_s=run.rate_rad_s[late]), i)
        )
    return out


@pytest.mark.slow
def test_runs_that_begin_in_motion_tell_as_little_and_say_so() -> None:
    off = []
    for seed in range(3):
        found = fitted(in_motion(seed), TRUTH[0])
        assert found.free_run is not None
        assert not any(s.rests for s in found.free_run.shots)
        off.append((found.values[INERTIA] - TRUTH[0]) / found.std_error(INERTIA))
    assert max(abs(x) for x in off) < 3.0


@pytest.mark.parametrize(
    ("seed", "begun"),
    [
        pytest.param(0, 1e-4, marks=pytest.mark.slow),
        pytest.param(2, 1e-4, marks=pytest.mark.slow),
        pytest.param(4, 8.714331e-5, marks=pytest.mark.slow),
        pytest.param(5, 1.293086e-04, marks=pytest.mark.slow),
        pytest.param(7, 6.847339e-5, marks=pytest.mark.slow),
    ],
)
def test_one_slow_run_leaves_the_inertia_open_or_nearly(seed: int, begun: float) -> None:
    traces = slow(seed)[:1]
    start = {INERTIA: begun, ("damping",): 0.0, ("stiffness",): TRUTH[2]}  # a ring that does not decay fits noise there
    use = [t.keep for t in traces]
    found = by_output_error(traces, Structure(), start, 0.1, use, use)
    error = found.std_error(INERTIA)
    assert error > 0.15 * found.values[INERTIA]
    assert abs(found.values[INERTIA] - TRUTH[0]) < 3.5 * error or error > 0.5 * found.values[INERTIA]


def test_a_known_mass_and_a_faint_ring_of_the_torque_tell_the_inertia() -> None:
    runs = []
    for number, (f, added) in enumerate(((0.5, 0.0), (1.0, 0.0), (1.0, 0.004))):
        jck = (TRUTH[0] + added, TRUTH[1], TRUTH[2])
        run = sine_run(100.0, f, duration_s=6.0, soft_s=0.3, seed=number, noise=LOUD, jck=jck)
        runs.append(prepare(replace(run, added_inertia_kg_m2=added), number))
    found = fitted(runs, 0.6 * TRUTH[0])
    assert found.values[INERTIA] == pytest.approx(TRUTH[0], rel=0.01)
    assert found.std_error(INERTIA) < 5e-3 * TRUTH[0]


def estimate(traces: Sequence[Trace], rests: bool = False) -> OutputErrorFit:
    start = {INERTIA: TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
    return refine(traces, Structure(), start, rests=rests)


def test_a_well_known_inertia_is_left_alone() -> None:
    traces = [prepare(sine_run(67.0, 6.0, seed=1)), prepare(sine_run(42.0, 9.0, seed=1))]
    free = estimate(traces)

    def never(*_: object, **__: object) -> OutputErrorFit:
        raise AssertionError("fitted again")

    assert not depends_on_ringing(free)
    assert with_fixed_initial_state(free, never) is free
    assert settled(free, never) == (free, None)


def test_a_run_held_to_rest_keeps_its_start_state() -> None:
    found = estimate(slow(2), rests=True)
    assert all(s.rests and s.first[0] == 0 for s in found.shots)
    assert all(np.array_equal(s.starts[0], [0.0, 0.0]) for s in found.shots)
    assert found.sigma == pytest.approx(LOUD, rel=0.03)
