"""What carries torque that an effect had taken up, once that is taken back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select import torque_search
from identify.select.torque_search import TorqueSearch
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, sine_run, traces_of

SETS = ((111.0, 1.0), (104.0, 3.0), (67.0, 6.0))


def search(drag: float) -> TorqueSearch:
    """Runs with Coulomb friction, and a torque that goes with the square of the rate."""
    there = {"coulomb_friction": {"level": 4.0}, "quadratic_damping": {"factor": drag}}
    runs = tuple(sine_run(*given, seed=k, effects=there) for k, given in enumerate(SETS))
    traces = traces_of(Recording(runs))
    regression = TorqueRegression(traces, split(traces, "auto"), 20.0, scale_of(traces, TRUTH, ()))
    base = regression.solve(Structure(), {})
    acceleration = float(np.sqrt(np.mean(regression.series()[2] ** 2)))
    offered = ["coulomb_friction", "quadratic_damping", "creep"]
    return TorqueSearch(regression, base, regression.noise_floor_nm(base.values), acceleration, offered)


def test_a_further_effect_is_found_beside_what_is_there_and_what_is_there_stays() -> None:
    begun = search(0.5)
    now = begun.regression.solve(Structure((*begun.base.structure.terms,), ("coulomb_friction",)), {})
    found, added = begun.with_others(now)
    assert found.structure.effects == ("coulomb_friction", "quadratic_damping")
    assert [(c.effect, c.status) for c in added] == [("quadratic_damping", "added")]
    assert found.values["quadratic_damping", "factor"] == pytest.approx(0.5, rel=0.05)


def test_nothing_is_added_where_nothing_carries_weight() -> None:
    begun = search(0.0)
    now = begun.regression.solve(Structure((*begun.base.structure.terms,), ("coulomb_friction",)), {})
    assert begun.with_others(now) == (now, [])


def test_what_follows_almost_any_torque_is_not_asked() -> None:
    asked: list[str] = []
    begun = search(0.5)
    begun.regression.evidence = lambda now, fit: asked.extend(fit.structure.effects) or 0.0  # type: ignore[method-assign]
    begun.with_others(begun.base)
    assert "coulomb_friction" in asked and "creep" not in asked


def test_nor_is_another_of_what_is_there_but_what_goes_with_the_rest_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A further order of cogging follows as much as the first; asked again, what was taken back would come back."""
    begun = replace(search(0.5), allowed=["coulomb_friction", "creep", "cogging"])
    now = begun.regression.solve(Structure((*begun.base.structure.terms,), ("cogging",)), {"cogging": (40.0,)})
    asked: list[str] = []
    monkeypatch.setattr(torque_search, "candidate_torques", lambda r, now, names, *a, **k: asked.extend(names) or [])
    begun.with_others(now, ["cogging_3"], "angle")
    assert asked == ["coulomb_friction"]
    asked.clear()
    begun.with_others(now, ["periodic_disturbance"], "angle")
    assert asked == ["coulomb_friction", "cogging_2"]


def test_the_way_to_the_result_is_kept() -> None:
    begun = search(0.5)
    best = begun.run()
    ways = [set(fit.structure.effects) for fit in begun.path]
    assert ways[-1] == {"coulomb_friction", "quadratic_damping"} and len(ways) == 2 and len(ways[0]) == 1
    assert begun.path[-1] is best
