"""Models side by side: judged on samples not fitted, by how much and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from identify.estimate.judged import Judged, advantage, delta_bic, horizon_s, judge, share_explained
from identify.estimate.output_error import Estimate, Name, names_of
from identify.model.structure import Structure
from identify.select.search_state import Search
from identify.signals.prepare import prepare
from tests.identify.simulated import NOISE_RAD_S, TRUTH, sine_run

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


def test_an_advantage_is_counted_in_standard_errors_over_paired_shots() -> None:
    rng = np.random.default_rng(1)
    old = 100.0 + rng.standard_normal(40)
    assert advantage(judged(old), judged(old * 0.9)) > 10
    noise = [advantage(judged(old), judged(old + rng.standard_normal(40))) for _ in range(40)]
    assert np.mean(np.abs(noise) < 2.5) > 0.9
    assert advantage(judged(old), judged(old * 1.1)) < -10


def test_two_equal_models_have_no_advantage_over_each_other() -> None:
    assert advantage(judged([1.0, 2.0, 3.0]), judged([1.0, 2.0, 3.0])) == 0.0


def test_the_share_explained_counts_only_what_lies_above_the_noise() -> None:
    old, new = judged([500.0]), judged([200.0])  # mean squares 5 and 2
    assert share_explained(old, new, 1.0) == pytest.approx(0.75)
    assert share_explained(judged([100.0]), judged([99.0]), 1.0) == 0.0, "nothing is left to explain"


def test_the_bic_charges_the_logarithm_of_the_samples_for_a_parameter() -> None:
    same = delta_bic(judged([1.0]), judged([1.0], ("coulomb_friction",)))
    assert same == pytest.approx(np.log(1000))
    better = delta_bic(judged([1.0]), judged([1.0], ("coulomb_friction",), sigma=0.5))
    assert better == pytest.approx(2000 * np.log(0.5) + np.log(1000))


def test_the_strength_of_an_effect_is_its_distance_from_zero_in_standard_errors() -> None:
    found = judged([1.0], ("coulomb_friction",), sigma=2.0, information=16.0, values=[1, 1, 1, 3])
    assert found.strength("coulomb_friction") == pytest.approx(3.0 / (2.0 / 4.0))


@pytest.mark.parametrize(("scale", "strength"), [(1.0, 0.0), (1.02, 0.04), (0.9, 0.2)])
def test_a_scale_is_as_strong_as_it_stands_from_one(scale: float, strength: float) -> None:
    found = judged([1.0], ("torque_scale",), sigma=2.0, information=16.0, values=[1, 1, 1, scale])
    assert found.strength("torque_scale") == pytest.approx(strength)


@pytest.mark.parametrize(
    ("base", "best", "effect", "free_running", "kept"),
    [
        (1.52, 1.18, "coulomb_friction", False, False),  # half of the excess: something else is there
        (1.52, 1.06, "coulomb_friction", False, True),
        (1.05, 1.02, "coulomb_friction", False, True),  # at the noise, which is known to a percent or two
        (5.0, 1.3, "coulomb_friction", False, True),  # nearly all
        (5.0, 1.3, "creep", False, False),  # nearly all, of what follows anything
        (1.05, 1.10, "coulomb_friction", True, True),  # over whole runs, where the horizon's errors are no measure
    ],
)
def test_what_is_named_has_to_explain_most_of_what_was_to_explain(
    base: float, best: float, effect: str, free_running: bool, kept: bool
) -> None:
    alone, named = judged([100.0 * base**2]), judged([100.0 * best**2], (effect,))
    search = Search(alone, named, 0.1, 1.0, free_running=free_running)
    search.drop_a_bad_lot()
    assert search.best is (named if kept else alone)


def test_what_the_data_refused_stays_refused_where_nothing_was_added() -> None:
    declared, left = judged([1.21 * 100.0], ("coulomb_friction",)), judged([1.20 * 100.0])
    search = Search(declared, left, 0.1, 1.0, dropped=[("coulomb_friction", "not needed")])
    search.drop_a_bad_lot()
    assert search.best is left
    assert search.dropped == [("coulomb_friction", "not needed")]


def test_a_limit_that_nothing_reaches_is_no_strong_effect() -> None:
    seen = judged([100.0], ("torque_saturation",), values=[0.01, 0.05, 500.0, 90.0])
    assert seen.strength("torque_saturation") == pytest.approx(90.0)
    information = seen.estimate.information.copy()
    information[3, 3] = 0.0
    unreached = replace(seen, estimate=replace(seen.estimate, information=information))
    assert unreached.strength("torque_saturation") == 0.0
    assert unreached.std_errors()[("torque_saturation", "limit")] == np.inf
    assert unreached.std_errors()[("stiffness",)] == pytest.approx(1.0)


def test_an_open_phase_does_not_weaken_an_amplitude_that_is_known() -> None:
    """The right cogging of a platform without a spring was left out: a gyro does not tell where its phase begins."""
    amplitude, phase, error, adrift = 0.01, 0.49, 1e-6, 0.2
    values = [1.0, 1.0, 1.0, amplitude * np.cos(phase), amplitude * np.sin(phase), 8.0]
    found = judged([1.0], ("cogging",), values=values)
    across, along = np.array([np.cos(phase), np.sin(phase)]), np.array([-np.sin(phase), np.cos(phase)])
    information = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 1e6])
    information[3:5, 3:5] = np.outer(across, across) / error**2 + np.outer(along, along) / adrift**2
    found = replace(found, estimate=replace(found.estimate, information=information, sigma=1.0))
    assert found.strength("cogging") == pytest.approx(amplitude / error / np.sqrt(2.0), rel=1e-4)


def test_an_effect_of_a_model_that_runs_away_stands_nowhere() -> None:
    found = judged([1.0], ("coulomb_friction",), information=16.0, values=[1, 1, 1, 3])
    across = found.estimate.information.copy()
    across[0, 1] = across[1, 0] = np.inf
    lost = replace(found, estimate=replace(found.estimate, information=across))
    assert lost.strength("coulomb_friction") == 0.0
    assert all(np.isinf(e) for e in lost.std_errors().values())


def test_the_horizon_is_three_periods_of_the_ring_or_the_time_constant_of_a_free_axis() -> None:
    traces = [prepare(sine_run(104, 3))]
    assert horizon_s(TRUTH, traces) == pytest.approx(3.0 / 29.3, rel=0.01)
    assert horizon_s((0.02, 0.04, 0.0), traces) == pytest.approx(0.5)
    assert horizon_s((0.02, 0.0, 0.0), traces) == pytest.approx(1.0)
    assert horizon_s((1e-9, 0.0, 677.3), traces) == pytest.approx(0.04), "never shorter than forty samples"


def test_a_model_with_the_hidden_friction_is_judged_at_the_noise_and_clearly_better_than_one_without() -> None:
    fitting = [prepare(sine_run(42, 9, effects=FRICTION, duration_s=2))]
    judging = [prepare(sine_run(67, 6, effects=FRICTION, duration_s=2))]
    plain = judge(fitting, judging, Structure(), JCK, 0.1)
    right = judge(
        fitting, judging, Structure(effects=("coulomb_friction",)), JCK | {("coulomb_friction", "level"): 0.5}, 0.1
    )
    assert plain.sigma > 5 * NOISE_RAD_S
    assert right.sigma == pytest.approx(NOISE_RAD_S, rel=0.05)
    assert advantage(plain, right) > 2.5
    assert delta_bic(plain, right) < -100
    assert share_explained(plain, right, NOISE_RAD_S) > 0.95
    assert right.values()["coulomb_friction", "level"] == pytest.approx(1.0, rel=0.01)
    assert right.strength("coulomb_friction") > 100
