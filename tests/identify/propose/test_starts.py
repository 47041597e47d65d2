"""Where a candidate's fit begins. That a delay is found far below the resonance: tests/system/test_follow_up.py."""

from __future__ import annotations

import numpy as np
import pytest

from identify.likelihood.fit import Fit
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.starts import stable_part
from identify.signals.prepare import prepare
from rig.arrays import Array
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run

RUN_S = 1.0


@pytest.fixture(scope="module")
def fit() -> Fit:
    problem = PredictionError([prepare(sine_run(67.0, 6.0, duration_s=RUN_S), 0)])
    return problem.fit(Structure(), {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)})


def falls(fit: Fit, term: str, share: float) -> Array:
    """A change that takes such a share of one term away."""
    change = np.zeros(len(fit.names))
    change[fit.names.index((term,))] = -share * fit.values[term,]
    return change


@pytest.mark.parametrize(
    ("term", "share"), [("damping", 0.9), ("damping", -5.0), ("stiffness", 0.99), ("inertia", 0.5)]
)
def test_a_change_that_leaves_a_platform_at_rest_is_taken_whole(fit: Fit, term: str, share: float) -> None:
    assert stable_part(fit, falls(fit, term, share), RUN_S) == 1.0


def test_of_one_that_leaves_a_ring_that_grows_only_a_part_is_taken(fit: Fit) -> None:
    """Amplitudes grow with exp(-C t / 2 J): at the limit by a factor of e in a run."""
    part = stable_part(fit, falls(fit, "damping", 100.0), RUN_S)
    left = fit.values["damping",] * (1.0 - 100.0 * part)
    assert left == pytest.approx(-2.0 * fit.values["inertia",] / RUN_S)


def test_of_one_that_leaves_a_platform_that_falls_over_only_a_part_is_taken(fit: Fit) -> None:
    """Angles grow with exp(sqrt(-K / J) t)."""
    part = stable_part(fit, falls(fit, "stiffness", 1.1), RUN_S)
    left = fit.values["stiffness",] * (1.0 - 1.1 * part)
    assert left == pytest.approx(-fit.values["inertia",] / RUN_S**2)


def test_both_together_are_as_short_as_the_shorter(fit: Fit) -> None:
    damping, stiffness = falls(fit, "damping", 100.0), falls(fit, "stiffness", 1.1)
    least = min(stable_part(fit, change, RUN_S) for change in (damping, stiffness))
    assert stable_part(fit, damping + stiffness, RUN_S) == least
