"""The final fit over whole runs: it keeps what they support, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from identify.conclude.final_models import FinalModels
from identify.estimate.initial_guess import first_guess
from identify.model.structure import Structure
from identify.results import Candidate
from identify.runs.holdout import split
from identify.select.search_state import Search
from rig.platform import Platform
from tests.identify.simulated import TRUTH, campaign, traces_of

FOUND = ("coulomb_friction", "quadratic_damping")
DECLARED = Platform(*TRUTH)


def final(drag: float) -> tuple[list[str], Search, list[str]]:
    """What the final fit keeps of a model that the search has found, of runs with Coulomb friction and some drag."""
    there = {"coulomb_friction": {"level": 4.0}, "quadratic_damping": {"factor": drag}}
    traces = traces_of(campaign(there))
    values = dict(zip((("inertia",), ("damping",), ("stiffness",)), TRUTH, strict=True))
    values |= {("coulomb_friction", "level"): 4.0, ("quadratic_damping", "factor"): max(drag, 1e-3)}  # type: ignore[dict-item]
    base: Any = SimpleNamespace(structure=Structure(), values=values)
    best: Any = SimpleNamespace(structure=Structure(effects=FOUND), values=values)
    search = Search(base, best, 1.0, 0.0, [Candidate(name, 1, -100.0, None, "added") for name in FOUND])
    said: list[str] = []
    start = first_guess(traces, Structure())
    models = FinalModels(traces, split(traces, "auto"), DECLARED, Structure(), start, said.append)
    return list(models.after(cast(Any, search)).structure.effects), search, said


def test_an_effect_that_does_not_differ_from_none_over_whole_runs_is_dropped() -> None:
    kept, search, said = final(0.0)
    assert kept == ["coulomb_friction"]
    assert list(search.best.structure.effects) == kept
    assert {c.effect: c.status for c in search.candidates}["quadratic_damping"] == "added, then no longer needed"
    assert any("whole runs are explained as well without it" in line for line in said)


def test_an_effect_that_does_stays() -> None:
    kept, _, said = final(0.5)
    assert kept == list(FOUND) and not any("explained as well" in line for line in said)
