"""What an effect of a model may be instead: the simpler one that it contains."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from identify.model.structure import Structure
from identify.select.equivalent_models import special_cases, twins
from identify.select.free_run_fit import Whole
from identify.select.free_run_search import FineSearch
from identify.select.search_state import Search
from tests.identify.select.test_free_run_search import START, offered
from tests.identify.simulated import campaign


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


def test_a_twin_of_other_parameters_begins_with_what_it_makes_of_the_platform(search: FineSearch) -> None:
    gravity = model(search, "unbalance", {"sine": -600.0, "cosine": 4.0})
    found = twins(gravity, "unbalance")
    stiffness = gravity.values()["stiffness",] - 600.0
    assert found["cubic_stiffness"] == {("stiffness",): stiffness, ("cubic_stiffness", "factor"): 100.0}
    assert found["quadratic_stiffness"] == {("stiffness",): stiffness, ("quadratic_stiffness", "factor"): -2.0}


def test_a_twin_of_the_same_parameters_begins_with_their_values(search: FineSearch) -> None:
    lag = model(search, "actuator_lag", {"time": 2e-4})
    assert twins(lag, "actuator_lag") == {"sensor_lag": {("sensor_lag", "time"): 2e-4}}


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
