"""What the final fit does without is no longer named, and the rest of the search stands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from identify.model.structure import Structure
from identify.results import Candidate
from identify.select.field_search import _unsupported
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


def test_of_what_the_search_in_torque_found_only_flexible_effects_are_asked_about() -> None:
    found = fit("torque_offset", "creep", "cogging", torque_offset=-5.0, creep=90.0, cogging=3.0)
    assert _unsupported(found, Structure(), by_likelihood=False) == "cogging"
    assert _unsupported(found, Structure(effects=("cogging",)), by_likelihood=False) is None  # it is declared
    assert _unsupported(fit("torque_offset", torque_offset=-5.0), Structure(), by_likelihood=False) is None


def test_of_what_the_likelihood_found_all_are_asked_about_but_those_that_another_builds_on() -> None:
    found = fit("stiffness_drift", "unbalance", stiffness_drift=-4.0, unbalance=-18.0)
    assert _unsupported(found, Structure(), by_likelihood=True) == "unbalance"
    built = fit("torque_offset", "quadratic_stiffness", torque_offset=-5.0, quadratic_stiffness=90.0)
    assert _unsupported(built, Structure(), by_likelihood=True) is None
