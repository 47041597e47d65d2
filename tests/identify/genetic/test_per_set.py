"""Each set for itself by the genetic algorithm, with the closed form and the bound beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.final_fit import FinalFit, by_output_error
from identify.estimate.initial_guess import Start, first_guess
from identify.estimate.regression import Regression, fit
from identify.genetic.linear_traces import linear_traces
from identify.genetic.per_set import _j_dec, condense, each_set, genetic, has_arrived, search_range
from identify.model.structure import Structure
from identify.results import GeneticRun
from identify.runs.holdout import split
from identify.signals.trace import Trace
from rig.config.identify import IdentifyConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import TERMS, Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, Effects, campaign, traces_of

CENTRE = {"inertia": 0.015, "damping": 0.1, "stiffness": 900.0}
QUICK = IdentifyConfig.model_validate({"genetic": {"population": 60, "generations": 80}})
TWO_SETS = ((104.0, 3.0), (42.0, 9.0))


def fitted(traces: list[Trace], effects: Effects) -> FinalFit:
    found = split(traces)
    start: dict[tuple[str, ...], float] = {(t,): v for t, v in zip(TERMS, TRUTH, strict=True)}
    start |= {(e, p): v for e, given in effects.items() for p, v in given.items()}
    return by_output_error(traces, Structure(effects=tuple(effects)), start, 0.1, found.final, found.everything)


def start_of(traces: list[Trace]) -> Start:
    return first_guess(traces, Structure())


def test_each_set_alone_and_all_together_find_the_truth_that_the_declared_model_does_not_know() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    sets, joint = each_set(traces, fitted(traces, {}), start_of(traces), CENTRE, IdentifyConfig(), "rotary")
    assert [s.frequency_hz for s in sets] == [3.0, 9.0]
    assert joint is not None
    for one in sets:
        assert one.accepted
        assert one.identifiable == TERMS
        np.testing.assert_allclose([one.parameters[t].value for t in TERMS], TRUTH, rtol=2e-3)
    np.testing.assert_allclose([joint.parameters[t] for t in TERMS], TRUTH, rtol=2e-3)


def test_sets_are_fitted_though_the_final_model_has_no_inertia(monkeypatch: pytest.MonkeyPatch) -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    begin, final = start_of(traces), fitted(traces, {})
    monkeypatch.setattr("identify.genetic.per_set._platform", lambda fitted: (0.0, 0.005, 0.08))
    sets, _ = each_set(traces, final, begin, CENTRE, QUICK, "rotary")
    for one in sets:
        np.testing.assert_allclose(one.parameters["inertia"].value, TRUTH[0], rtol=2e-3)


def test_the_best_individual_stands_beside_the_closed_form_with_the_gap_between_them() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    run = genetic("all", traces, TERMS, start_of(traces), CENTRE, QUICK, 1, 0.0, beside=True)
    for term in TERMS:
        gap = 100 * abs(run.parameters[term] / run.closed_form[term] - 1)
        assert run.gap_percent[term] == pytest.approx(gap, rel=1e-6, abs=1e-9)
        assert gap < 0.2
    assert run.closed_form_objective is not None
    assert run.closed_form_objective <= run.objective < run.j_dec
    assert len(run.history) == 80
    assert set(run.roulette_only) == set(run.plain_objective) == set(TERMS)


def test_the_objective_at_the_optimum_is_the_gyros_noise_energy() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    found = condense(traces, TERMS, start_of(traces), 0.0)
    assert found.objective.minimum == pytest.approx(found.count * NOISE_RAD_S**2, rel=0.05)
    assert found.floor == pytest.approx(found.objective.minimum, rel=0.15)


def test_plain_equation_error_scatters_more_in_damping_than_the_prefiltered_one_and_is_biased() -> None:
    plain, white = [], []
    for seed in range(5):
        traces = traces_of(campaign(sets=((111.0, 0.5),), seed=seed))
        for out, kind in ((plain, True), (white, False)):
            out.append(condense(traces, TERMS, start_of(traces), 0.0, plain=kind).objective.closed_form[1])
    assert np.std(plain) > 4 * np.std(white)
    assert abs(np.mean(plain) - TRUTH[1]) > 10 * abs(np.mean(white) - TRUTH[1])


def test_declared_values_a_hundred_times_apart_give_the_same_answer() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    low, high = (
        genetic("all", traces, TERMS, start_of(traces), {k: f * v for k, v in CENTRE.items()}, QUICK, 1, 0.0, False)
        for f in (0.1, 10.0)
    )
    for term in TERMS:
        assert low.closed_form[term] == high.closed_form[term]
        assert low.parameters[term] == pytest.approx(high.parameters[term], rel=2e-2 if term == "damping" else 2e-3)


def test_the_range_spans_ten_times_the_declared_value_and_never_excludes_the_data() -> None:
    low, high = search_range(TERMS, np.array([0.02, -0.3, 1e5]), CENTRE, 10.0)
    assert high[0] == pytest.approx(0.2)
    assert low[1] == pytest.approx(-3.0)
    assert low[0] == 0.0
    assert high[2] == pytest.approx(1e6), "the data's own optimum lies well inside"


@pytest.mark.parametrize(
    "effects", [{"coulomb_friction": {"level": 1.2}}, {"torque_delay": {"delay": 1.5e-3}}], ids=str
)
def test_with_its_effects_taken_off_a_set_answers_to_the_linear_equation(effects: Effects) -> None:
    traces = traces_of(campaign(effects, sets=TWO_SETS, duration_s=2))
    linear = linear_traces(traces, fitted(traces, effects))
    for trace in linear:
        found = fit(Regression([replace(trace, number=0)], Structure()), {}, TRUTH, 0.0, 8)
        assert found.sigma < 1.6 * NOISE_RAD_S
        np.testing.assert_allclose(found.vector, TRUTH, rtol=5e-3)


def test_a_result_repeats_itself_and_another_seed_gives_another_population() -> None:
    traces = traces_of(campaign(sets=TWO_SETS))
    runs = [genetic("all", traces, TERMS, start_of(traces), CENTRE, QUICK, s, 0.0, False) for s in (1, 1, 2)]
    assert runs[0].parameters == runs[1].parameters
    assert runs[0].parameters != runs[2].parameters


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 3))])  # one noise of many
def test_a_set_that_hardly_tells_its_numbers_apart_says_so_in_their_errors(seed: int) -> None:
    truth = (0.02, 0.1, 20.0)
    time = np.arange(4001) * 5e-3
    torque = TorqueSignal(time, np.minimum(time / 8.0, 1.0) * np.sin(2 * np.pi * time))
    rate = simulate(Platform(*truth), time, torque, substeps=16).sensed_rate_rad_s
    rate = rate + 0.002 * np.random.default_rng(seed).standard_normal(len(time))
    run = Run("1 Hz", time, np.ones(len(time), bool), rate_rad_s=rate, torque_time_s=time, torque_nm=torque.torque_nm)
    traces = traces_of(Recording((run,)))
    sets, _ = each_set(traces, fitted(traces, {}), start_of(traces), CENTRE, QUICK, "rotary")
    for term, value in zip(TERMS, truth, strict=True):
        found = sets[0].parameters.get(term)
        assert found is None or abs(found.value - value) < 3.0 * found.std_error, term


@pytest.mark.parametrize(("minimum", "j_dec"), [(1.0, 1.2), (1.3, 1.326), (2.5, 1.2)])
def test_j_dec_is_out_of_reach_only_of_a_set_that_is_far_from_the_noise(minimum: float, j_dec: float) -> None:
    assert _j_dec(minimum, 1.0) == pytest.approx(j_dec)


@pytest.mark.parametrize(("objective", "lowest", "arrived"), [(1.01, 1.0, True), (1.2, 1.0, False), (1.0, None, False)])
def test_a_search_has_arrived_where_its_objective_goes_no_lower(
    objective: float, lowest: float | None, arrived: bool
) -> None:
    run = GeneticRun(
        "1 Hz", {}, {}, {}, objective, 0.5, 5, False, np.ones(3), {}, {}, closed_form_objective=lowest,
    )  # fmt: skip
    assert has_arrived(run) is arrived
