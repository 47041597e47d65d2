"""What the final fit does without is no longer named, and the rest of the search stands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from identify.model.structure import Structure
from identify.results import Candidate
from identify.select.field_search import _weakest
from identify.select.search_state import Search


def fit(*effects: str, **support: float) -> Any:
    return SimpleNamespace(structure=Structure(effects=effects), support_of=lambda name: support[name])


def test_a_dropped_effect_is_no_longer_told_as_added_and_leaves_its_rivals() -> None:
    added = [Candidate(name, 1, -100.0, None, "added") for name in ("coulomb_friction", "periodic_disturbance")]
    search = Search(fit(), fit("coulomb_friction", "periodic_disturbance"), 0.0, 0.0, added)
    search.rivals = {"coulomb_friction": ("stribeck_friction",), "periodic_disturbance": ("cogging",)}
    search.rival_models = {"periodic_disturbance": {"cogging": cast(Any, None)}}
    final = fit("coulomb_friction")
    search.drop(final)
    assert search.best is final
    assert [c.status for c in search.candidates] == ["added", "added, then no longer needed"]
    assert search.rivals == {"coulomb_friction": ("stribeck_friction",)}
    assert search.rival_models == {}


def test_the_weakest_is_found_among_the_flexible_ones() -> None:
    found = fit("torque_offset", "creep", "cogging", torque_offset=-5.0, creep=90.0, cogging=3.0)
    assert _weakest(found, Structure()) == "cogging"
    assert _weakest(found, Structure(effects=("cogging",))) == "creep"
    assert _weakest(fit("torque_offset", torque_offset=-5.0), Structure()) is None
