"""Which parameters of a fit are not to be reported, on fits whose covariance is given."""

from dataclasses import replace

import numpy as np

from identify.bounds.undetermined import open_phases, undetermined
from identify.estimate.final_fit import FinalFit
from identify.model.parameters import Name
from identify.model.structure import Structure
from rig.recording.run import Array
from tests.identify.bounds.given_fit import final_fit

TERMS: tuple[Name, ...] = (("inertia",), ("damping",), ("stiffness",))


def fitted(errors: Array, tie: float = 0.0, determined: tuple[bool, ...] = (True,) * 3) -> FinalFit:
    """J, C, K of 1, 2, 3 with these standard errors; ``tie`` correlates inertia and stiffness."""
    correlation = np.eye(3)
    correlation[0, 2] = correlation[2, 0] = tie
    values = dict(zip(TERMS, (1.0, 2.0, 3.0), strict=True))
    covariance = correlation * np.outer(errors, errors)
    return replace(final_fit(Structure(), values, covariance), determined=determined)


def test_what_is_known_well_is_not_listed() -> None:
    assert undetermined(fitted(np.array([0.01, 0.1, 0.1])), {0}, alone=False) == {}


def test_an_error_beyond_half_of_the_value_is_said_with_both() -> None:
    why = undetermined(fitted(np.array([0.01, 1.5, 0.1])), {0}, alone=False)
    assert list(why) == [("damping",)]
    assert "1.5" in why[("damping",)]
    assert "2" in why[("damping",)]


def test_what_models_that_the_data_do_not_part_disagree_on_is_not_determined() -> None:
    """An inertia of 1 +- 0.01 by its own model, and of 1.7 by another that is as likely, was accepted."""
    apart = replace(fitted(np.array([0.01, 0.1, 0.1])), between_rivals={("inertia",): 0.7, ("damping",): 0.7})
    why = undetermined(apart, {0}, alone=False)
    assert list(why) == [("inertia",)]
    assert "models that these data do not tell apart" in why[("inertia",)]


def test_what_the_data_hold_nothing_of_is_said_even_where_its_error_looks_small() -> None:
    why = undetermined(fitted(np.array([0.01, 0.1, 0.1]), determined=(True, False, True)), {0}, alone=False)
    assert list(why) == [("damping",)]
    assert "no information" in why[("damping",)]


def test_a_term_that_is_one_with_a_lost_one_is_lost_as_well() -> None:
    lost_stiffness = np.array([0.01, 0.1, 2.0])
    assert list(undetermined(fitted(lost_stiffness, tie=0.5), {0}, alone=False)) == [("stiffness",)]
    assert list(undetermined(fitted(lost_stiffness, tie=0.99), {0}, alone=False)) == [("inertia",), ("stiffness",)]


def test_in_a_single_run_inertia_goes_with_a_lost_stiffness_however_little_they_correlate() -> None:
    why = undetermined(fitted(np.array([0.01, 0.1, 2.0])), {0}, alone=True)
    assert "only its combination with stiffness" in why[("inertia",)]


def test_a_parameter_of_a_run_that_no_fit_looked_at_is_not_listed() -> None:
    name: Name = ("periodic_disturbance", "phase", "3")
    structure, values = Structure(("inertia",), ("periodic_disturbance",)), {("inertia",): 1.0, name: 0.0}
    lost = replace(final_fit(structure, values, np.diag([1e-4, np.inf])), determined=(True, False))
    assert undetermined(lost, {0, 1}, alone=False) == {}
    assert list(undetermined(lost, {0, 1, 3}, alone=False)) == [name]


def test_a_phase_that_may_be_anything_leaves_its_gains_open_by_their_amplitude() -> None:
    pair: tuple[Name, ...] = (("cogging", "sine"), ("cogging", "cosine"))
    values = dict(zip(pair, (0.01, 0.0), strict=True))

    def of(cosine_error: float) -> dict[Name, float]:
        covariance = np.diag([3e-5, cosine_error]) ** 2
        return open_phases(final_fit(Structure((), ("cogging",)), values, covariance))

    assert of(1e-3) == {}
    assert of(0.14) == {pair[0]: 0.01, pair[1]: 0.14}
