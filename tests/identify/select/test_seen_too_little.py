"""What repeats has to be seen to repeat: a wave of which the travel shows less than two periods, a source in time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from identify.likelihood.fit import Fit
from identify.model.structure import Structure
from identify.select import forward_selection, stepwise
from identify.select.curve_rivals import not_as_strong, seen_too_little
from identify.select.forward_selection import gone_on_without
from identify.select.likelihood_search import LikelihoodSearch
from identify.select.stepwise import Stepwise

TRAVEL_DEG = 9.0
WAVE = Structure(effects=("cogging",))


def of_periods(periods: float, chi_square: float = 2.0) -> Fit:
    order = periods * 2.0 * np.pi / (2.0 * np.radians(TRAVEL_DEG))
    values = {("cogging", "sine"): 1.0, ("cogging", "cosine"): 0.0, ("cogging", "order"): order}
    return cast(Fit, SimpleNamespace(structure=WAVE, values=values, reduced_chi_square=chi_square))


def searched(best: Fit, weight: float = 0.0) -> Stepwise:
    """A search that has found a wave, of which ``weight`` is what it explains of what others in its place leave."""
    traces = [SimpleNamespace(travel_deg=t) for t in (4.0, TRAVEL_DEG)]
    evidence = SimpleNamespace(support=1e3, weight=weight)
    weigher = SimpleNamespace(evidence=lambda name, less, more: evidence)
    base = cast(Fit, SimpleNamespace(structure=Structure()))
    problem: Any = SimpleNamespace(traces=traces)
    search = Stepwise(problem, base, ["cogging", "cubic_stiffness"], cast(Any, weigher))
    search.best = best
    return search


@pytest.mark.parametrize(
    ("periods", "chi_square", "asked"), [(1.9, 2.0, True), (2.1, 2.0, False), (0.8, 1.05, False), (0.8, 1.2, True)]
)
def test_beside_a_disturbance_a_wave_is_asked_for_two_periods(periods: float, chi_square: float, asked: bool) -> None:
    best = of_periods(periods, chi_square)
    assert list(seen_too_little(searched(best), best)) == ["cogging"] * asked


@pytest.mark.parametrize(("weight", "stays"), [(0.1, False), (0.9, True)])
def test_a_wave_that_is_not_seen_twice_stays_where_nothing_else_explains_as_much(
    weight: float, stays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    cubic = cast(Fit, SimpleNamespace(structure=Structure(effects=("cubic_stiffness",))))
    monkeypatch.setattr(Stepwise, "without", lambda search, now, name, steps: search.base)
    monkeypatch.setattr(Stepwise, "concluded", lambda search: search)
    monkeypatch.setattr(forward_selection, "add_effects", lambda search: setattr(search, "best", cubic))
    search = searched(of_periods(0.7), weight)
    said: list[str] = []
    search.say = said.append
    instead = gone_on_without(search, {"cogging": "it is not seen twice"})
    assert search.best.structure == WAVE and search.dropped == [] and "cogging" in search.allowed
    if stays:
        assert instead is None and said[-1] == "kept cogging: explains 90 % of what the others leave"
    else:
        assert instead is not None and instead.best is cubic
        assert instead.dropped == [("cogging", "it is not seen twice")]
        assert list(instead.allowed) == ["cubic_stiffness"] and instead.stood_for_curves == {"cogging"}


def test_the_search_without_it_is_the_one_to_go_on_with(monkeypatch: pytest.MonkeyPatch) -> None:
    search, instead = searched(of_periods(0.7)), searched(of_periods(2.1))
    monkeypatch.setattr(stepwise, "with_others_in_place", lambda search, now: now)
    monkeypatch.setattr(Stepwise, "re_evaluate", lambda search, now: now)
    monkeypatch.setattr(stepwise, "not_as_strong", lambda fit, names: {})
    monkeypatch.setattr(stepwise, "gone_on_without", lambda search, why: instead)
    assert search.concluded() is instead
    monkeypatch.setattr(stepwise, "add_effects", lambda search: None)
    whole = LikelihoodSearch(search, [], WAVE, cast(Any, None))
    whole.run()
    assert whole.stepwise is instead


def test_a_tone_that_goes_with_what_is_played_is_refuted_and_one_from_outside_is_not() -> None:
    def tone(*sizes: float) -> Fit:
        values = {("periodic_disturbance", "sine", str(k)): s for k, s in enumerate(sizes)}
        values |= {("periodic_disturbance", "cosine", str(k)): 0.0 for k in range(len(sizes))}
        return cast(Fit, SimpleNamespace(values=values, std_error=lambda name: 0.01))

    assert (
        "as strong in every run" in not_as_strong(tone(1.5, 2.7, 0.4), ["periodic_disturbance"])["periodic_disturbance"]
    )
    assert not_as_strong(tone(1.5, 1.6, 1.4), ["periodic_disturbance", "cogging"]) == {}
