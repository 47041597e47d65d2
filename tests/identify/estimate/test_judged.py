"""A model as the report sees it: its held-out error, what it explains, its standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.judged import Judged, horizon_s, share_explained
from identify.estimate.output_error import Estimate, Name, names_of
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from tests.identify.simulated import TRUTH, sine_run

JCK: dict[Name, float] = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
FRICTION = {"coulomb_friction": {"level": 1.0}}


def judged(
    losses: Sequence[float], effects: tuple[str, ...] = (), sigma: float = 1.0, information: float = 1.0,
    values: Sequence[float] | None = None,
) -> Judged:  # fmt: skip
    structure = Structure(effects=effects)
    names = names_of(structure, 1)
    x = np.ones(len(names)) if values is None else np.array(values, dtype=float)
    estimate = Estimate(structure, names, x, sigma, 1000, information * np.eye(len(names)), (), True)
    return Judged(structure, estimate, np.array(losses, dtype=float), np.full(len(losses), 100.0))


def test_the_held_out_error_is_a_geometric_mean_so_that_one_lost_shot_does_not_decide() -> None:
    quiet = judged([100.0] * 20)
    lost = judged([100.0] * 19 + [1e6])
    assert quiet.sigma == pytest.approx(1.0)
    assert lost.sigma < 1.3


def test_the_share_explained_counts_only_what_lies_above_the_noise() -> None:
    old, new = judged([500.0]), judged([200.0])  # mean squares 5 and 2
    assert share_explained(old, new, 1.0) == pytest.approx(0.75)
    assert share_explained(judged([100.0]), judged([99.0]), 1.0) == 0.0, "nothing is left to explain"


def test_a_limit_that_nothing_reaches_has_no_standard_error() -> None:
    seen = judged([100.0], ("torque_saturation",), values=[0.01, 0.05, 500.0, 90.0])
    information = seen.estimate.information.copy()
    information[3, 3] = 0.0
    unreached = replace(seen, estimate=replace(seen.estimate, information=information))
    assert unreached.std_errors()[("torque_saturation", "limit")] == np.inf
    assert unreached.std_errors()[("stiffness",)] == pytest.approx(1.0)


def test_an_effect_of_a_model_that_runs_away_stands_nowhere() -> None:
    found = judged([1.0], ("coulomb_friction",), information=16.0, values=[1, 1, 1, 3])
    across = found.estimate.information.copy()
    across[0, 1] = across[1, 0] = np.inf
    lost = replace(found, estimate=replace(found.estimate, information=across))
    assert all(np.isinf(e) for e in lost.std_errors().values())


def test_the_horizon_is_three_periods_of_the_ring_or_the_time_constant_of_a_free_axis() -> None:
    traces = [prepare(sine_run(104, 3))]
    assert horizon_s(TRUTH, traces) == pytest.approx(3.0 / 29.3, rel=0.01)
    assert horizon_s((0.02, 0.04, 0.0), traces) == pytest.approx(0.5)
    assert horizon_s((0.02, 0.0, 0.0), traces) == pytest.approx(1.0)
    assert horizon_s((1e-9, 0.0, 677.3), traces) == pytest.approx(0.04), "never shorter than forty samples"
