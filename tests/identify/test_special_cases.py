"""What an effect of a model may be instead: the simpler one that it contains."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from identify.fine import FineSearch
from identify.found import Search
from identify.regression import Structure
from identify.special_cases import special_cases
from identify.whole_runs import Whole
from tests.identify.simulated import campaign
from tests.identify.test_fine import START, offered


def model(search: FineSearch, name: str, values: Mapping[str, float]) -> Whole:
    fitted = search.whole(Structure(effects=(name,)), {**START, **{(name, p): v for p, v in values.items()}}, steps=0)
    assert fitted is not None
    return fitted


@pytest.fixture(scope="module")
def search() -> FineSearch:
    return offered(campaign({"coulomb_friction": {"level": 0.3}}, sets=((104.0, 3.0), (42.0, 9.0)), duration_s=2))


def test_a_gain_begins_from_the_largest_of_the_richer_one(search: FineSearch) -> None:
    stribeck = model(search, "stribeck_friction", {"coulomb": 0.0, "static": 0.3, "speed": 1e9})
    assert special_cases(stribeck, "stribeck_friction") == {"coulomb_friction": {("coulomb_friction", "level"): 0.3}}


def test_what_contains_nothing_has_no_special_case(search: FineSearch) -> None:
    assert special_cases(model(search, "coulomb_friction", {"level": 0.3}), "coulomb_friction") == {}


def test_a_shape_that_the_data_leave_open_gives_way_to_the_special_case(search: FineSearch) -> None:
    stribeck = model(search, "stribeck_friction", {"coulomb": 0.0, "static": 0.3, "speed": 1e9})
    fitted = search.whole(stribeck.structure, stribeck.values())
    bare = search.whole(Structure(), START)
    assert fitted is not None
    assert bare is not None
    found = Search(bare.judged(), bare.judged(), 0.1, search.noise)
    simpler = search._asked_again(found, fitted, newest=0)
    assert simpler.structure.effects == ("coulomb_friction",)
    np.testing.assert_allclose(simpler.values()["coulomb_friction", "level"], 0.3, rtol=1e-2)
