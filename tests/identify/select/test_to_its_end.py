"""A fit that is kept has arrived before the next effect is looked for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.select.forward_selection import MOST_PASSES, _to_its_end
from identify.signals.prepare import prepare
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run


@pytest.fixture(scope="module")
def problem() -> PredictionError:
    return PredictionError([prepare(sine_run(67.0, 6.0, duration_s=1.0), 0)])


@pytest.fixture(scope="module")
def short(problem: PredictionError) -> Fit:
    """Begun far off and stopped after two steps."""
    return problem.fit(Structure(), {(k,): 3.0 * v for k, v in zip(TERMS, TRUTH, strict=True)}, iterations=2)


def going_on(problem: PredictionError, steps: int) -> Any:
    """A search that goes on by so many steps at a time."""

    def further(fit: Fit) -> Fit:
        return problem.fit(fit.structure, fit.values, fit.noise, steps, carry=fit.shots)

    return SimpleNamespace(trials=SimpleNamespace(further=further))


def test_a_fit_says_whether_it_has_arrived(problem: PredictionError, short: Fit) -> None:
    assert not short.arrived
    whole = problem.fit(Structure(), short.values, short.noise, 60, carry=short.shots)
    assert whole.arrived
    assert whole.cost < short.cost - 10.0


def test_one_that_was_only_compared_does_not_claim_it(problem: PredictionError, short: Fit) -> None:
    assert not problem.fit(Structure(), short.values, short.noise, 60, carry=short.shots, against=0.0).arrived


def test_what_is_kept_goes_on_until_it_has_arrived(problem: PredictionError, short: Fit) -> None:
    whole = problem.fit(Structure(), short.values, short.noise, 60, carry=short.shots)
    assert _to_its_end(going_on(problem, 20), short).cost == pytest.approx(whole.cost, abs=1.0)


def test_it_ends_where_no_step_leads_down_or_after_a_few_passes(short: Fit) -> None:
    passes: list[float] = []

    def further(fall: float) -> Any:
        def once(fit: Fit) -> Fit:
            passes.append(fall)
            return replace(fit, cost=fit.cost - fall)

        return SimpleNamespace(trials=SimpleNamespace(further=once))

    _to_its_end(further(0.0), short)
    assert len(passes) == 1
    _to_its_end(further(1e3), short)
    assert len(passes) == 1 + MOST_PASSES
    _to_its_end(further(1e3), replace(short, arrived=True))
    assert len(passes) == 1 + MOST_PASSES
