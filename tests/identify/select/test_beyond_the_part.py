"""A search looks at the part of a recording that tells most; it goes on with more where that shows something else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from identify.estimate.initial_guess import first_guess
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import Split, split
from identify.runs.reduced import reduced
from identify.select import likelihood_search
from identify.select.likelihood_search import SAMPLES, LikelihoodSearch
from identify.select.stepwise import Stepwise
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH, Effects, white

PART, ALL = 1_500, 3_000  # samples at 1 kHz
FRICTION: Effects = {"coulomb_friction": {"level": 1.0}}
CLIPS: Effects = {"torque_saturation": {"limit": 45.0}}


def swelling(hidden: Effects) -> Run:
    """A sine that grows half-way from 30 to 60 N m."""
    time = np.arange(ALL + 1) * 1e-3
    torque = TorqueSignal(time, np.where(time < 1e-3 * PART, 30.0, 60.0) * np.sin(2 * np.pi * 2.0 * time))
    rate = simulate(Platform(*TRUTH, hidden), time, torque, substeps=16).sensed_rate_rad_s
    rate = rate + white(len(time), NOISE_RAD_S)
    return Run("run", time, np.ones(len(time), bool), rate_rad_s=rate, torque_time_s=time, torque_nm=torque.torque_nm)


def beginning(traces: Sequence[Trace], parts: Split, enough: int) -> tuple[list[Trace], Split]:
    """The first half for the search, and all where more is asked for."""
    few, cut = reduced(traces, parts, enough)
    if enough > SAMPLES:
        return few, cut
    pieces = [t.piece(0, PART) for t in few]
    fit, judge = ([m[: PART + 1] for m in masks] for masks in (cut.fit, cut.judge))
    return pieces, Split(fit, judge, [t.keep for t in pieces], cut.note)


def searched(hidden: Effects, monkeypatch: pytest.MonkeyPatch) -> tuple[LikelihoodSearch, list[str]]:
    monkeypatch.setattr(likelihood_search, "reduced", beginning)
    traces = [prepare(swelling(hidden), 0, NOISE_RAD_S)]
    declared: dict[Name, float] = dict(zip([("inertia",), ("damping",), ("stiffness",)], TRUTH, strict=True))
    said: list[str] = []
    search = LikelihoodSearch.of(
        traces, split(traces, "auto"), Structure(), declared, first_guess(traces, Structure()),
        ["coulomb_friction", "torque_saturation"], said.append,
    )  # fmt: skip
    search.run()
    return search, [s for s in said if s.startswith("searching on with")]


@pytest.mark.slow
def test_what_only_the_rest_shows_is_found_and_what_the_part_showed_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    search, said = searched({**FRICTION, **CLIPS}, monkeypatch)
    assert len(said) == 1
    best = search.stepwise.best
    assert set(best.structure.effects) == {"coulomb_friction", "torque_saturation"}
    assert best.values["torque_saturation", "limit"] == pytest.approx(45.0, rel=0.01)
    assert best.values["inertia",] == pytest.approx(TRUTH[0], rel=1e-3)
    statuses = {c.effect: c.status for c in search.found.candidates if c.status == "added"}
    assert set(statuses) == {"coulomb_friction", "torque_saturation"}


def test_where_it_ends_with_no_other_effect_the_part_keeps_its_model_and_all_that_it_knows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    concluded = Stepwise.concluded

    def taking_all_back(search: Stepwise) -> Stepwise:
        if not search.settled:
            return concluded(search)
        search.stood_for_curves.add("coulomb_friction")
        search.dropped.append(("coulomb_friction", "a curve"))
        search.inflation["coulomb_friction"] = np.inf
        search.rivals.clear()
        search.best = search.base
        return search

    monkeypatch.setattr(Stepwise, "concluded", taking_all_back)
    search, said = searched({**FRICTION, **CLIPS}, monkeypatch)
    kept = search.stepwise
    assert len(said) == 1 and search.earlier == ()
    assert kept.best.structure.effects == ("coulomb_friction",)
    assert kept.problem.traces[0].measured.shape == (PART + 1,)
    assert kept.stood_for_curves == set() and kept.dropped == [] and "coulomb_friction" in kept.rivals
    assert np.isfinite(kept.inflation["coulomb_friction"])


def test_where_the_part_shows_all_the_search_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    search, said = searched(FRICTION, monkeypatch)
    assert not said and search.earlier == ()
    assert search.stepwise.best.structure.effects == ("coulomb_friction",)
    assert search.stepwise.problem.traces[0].measured.shape == (PART + 1,)
