"""A candidate that contains another is judged by a fit that is no worse than that one's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.select.trial_fits import TrialFits
from identify.signals.prepare import one_noise, prepare
from tests.identify.simulated import TRUTH, sine_run

PLAIN = Structure(("inertia", "damping", "stiffness"))
PLATFORM: dict[Name, float] = dict(zip([("inertia",), ("damping",), ("stiffness",)], TRUTH, strict=True))


def fitted(duration_s: float) -> tuple[PredictionError, Fit, Fit]:
    """A run with Coulomb friction, and fits of it without and with that."""
    run = sine_run(67.0, 6.0, effects={"coulomb_friction": {"level": 2.0}}, duration_s=duration_s)
    problem = PredictionError(one_noise([prepare(run)], False))
    now = problem.fit(PLAIN, PLATFORM, iterations=3, thorough=False)
    level: dict[Name, float] = {("coulomb_friction", "level"): 2.0}
    return problem, now, problem.fit(PLAIN.plus("coulomb_friction"), {**PLATFORM, **level}, now.noise, thorough=False)


def test_a_richer_friction_that_ended_elsewhere_begins_again_where_its_special_case_stands() -> None:
    problem, now, coulomb = fitted(2.0)
    off: dict[Name, float] = {
        ("stribeck_friction", "coulomb"): 0.1,
        ("stribeck_friction", "static"): 5.0,
        ("stribeck_friction", "speed"): 3.0,
    }
    stribeck = problem.fit(PLAIN.plus("stribeck_friction"), {**PLATFORM, **off}, now.noise, 1, thorough=False)
    assert stribeck.cost > coulomb.cost + 100.0  # as it was left
    trials = TrialFits(problem, PLAIN, ["coulomb_friction", "stribeck_friction"], None)  # type: ignore[arg-type]
    fits = trials.no_worse_than_special_cases(now, {"stribeck_friction": stribeck, "coulomb_friction": coulomb})
    assert fits["coulomb_friction"] is coulomb
    assert fits["stribeck_friction"].cost < coulomb.cost + 1.0
    assert np.isclose(fits["stribeck_friction"].values[("stribeck_friction", "static")], 2.0, rtol=0.2)


def test_a_fit_that_is_no_worse_stays() -> None:
    problem, now, coulomb = fitted(1.0)
    better = replace(coulomb, cost=coulomb.cost - 1.0)
    trials = TrialFits(problem, PLAIN, [], None)  # type: ignore[arg-type]
    fits = trials.no_worse_than_special_cases(now, {"stribeck_friction": better, "coulomb_friction": coulomb})
    assert fits["stribeck_friction"] is better
