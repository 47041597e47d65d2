"""The quick look at every candidate, and the first idea of the platform that it starts from."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimate.initial_guess import best_rho, first_guess, scale_of
from identify.model.structure import Structure
from identify.propose.screening import Screen, Screened, allowed, grid_of
from identify.signals.trace import Trace
from rig import effects
from rig.platform import Platform
from rig.recording.run import Recording
from tests.identify.simulated import TRUTH, campaign, decay_run, traces_of
from tests.rig.effects.values import VALUES

PLAIN = Structure()
TRIED = [n for n in effects.names() if n not in ("sensor_lag", "rate_bias", "torque_offset")]


def traces(hidden: str | None = None) -> list[Trace]:
    return traces_of(campaign({hidden: VALUES[hidden]} if hidden else None, duration_s=2.0))


def looked(of: list[Trace], names: list[str]) -> list[Screened]:
    screen = Screen(of, PLAIN, {}, first_guess(of, PLAIN))
    return screen.all(names)


def test_the_first_idea_comes_from_the_data_alone() -> None:
    guess = first_guess(traces(), PLAIN)
    np.testing.assert_allclose(guess.platform[::2], TRUTH[::2], rtol=1e-3)
    assert 20.0 < guess.cutoff_hz <= 100.0


def test_a_quiet_sensor_lets_the_low_pass_reach_further() -> None:
    noisy = first_guess(traces_of(campaign(duration_s=2.0, noise=0.05)), PLAIN)
    assert noisy.cutoff_hz < first_guess(traces(), PLAIN).cutoff_hz


@pytest.mark.parametrize("hidden", ["coulomb_friction", "cubic_stiffness", "torque_delay", "quadratic_damping"])
def test_the_hidden_effect_is_the_best_or_near_it(hidden: str) -> None:
    order = looked(traces(hidden), TRIED)
    near = [s.effect for s in order if s.gain > 0.7 * order[0].gain]
    assert hidden in near


def test_where_nothing_is_hidden_no_candidate_gains_more_than_chance() -> None:
    order = looked(traces(), ["coulomb_friction", "cubic_stiffness", "torque_delay", "quadratic_damping", "backlash"])
    assert max(s.gains[0] for s in order) < 20.0


def test_shapes_are_searched_to_the_hidden_delay() -> None:
    (found,) = looked(traces("torque_delay"), ["torque_delay"])
    assert found.shapes["torque_delay"][0] == pytest.approx(1.5e-3, rel=0.05)


def test_a_sensor_effect_is_a_nuisance_and_never_looked_at() -> None:
    assert looked(traces(), ["rate_bias", "sensor_lag"]) == []


def test_friction_that_pushes_and_a_static_level_below_the_coulomb_level_are_not_allowed() -> None:
    assert not allowed({("coulomb_friction", "level"): -0.1}, "coulomb_friction")
    assert allowed({("coulomb_friction", "level"): 0.1}, "coulomb_friction")
    levels = {("stribeck_friction", "coulomb"): 2.0, ("stribeck_friction", "static"): 1.0}
    assert not allowed(levels, "stribeck_friction")
    assert allowed({("cubic_stiffness", "factor"): -5.0}, "cubic_stiffness")


def test_the_grid_of_starts_is_the_product_of_what_each_shape_proposes() -> None:
    scale = scale_of(traces(), TRUTH, ())
    hysteresis = effects.get("hysteresis")
    sizes = [len(p.start(scale)) for p in hysteresis.parameters if p.start]
    assert len(grid_of(hysteresis, scale)) == np.prod(sizes)
    assert grid_of(effects.get("coulomb_friction"), scale) == [()]


def test_the_scale_of_the_motion_is_what_it_is() -> None:
    scale = scale_of(traces(), TRUTH, (50.0,))
    assert scale.natural_frequency_hz == pytest.approx(29.3, abs=0.05)
    assert scale.torque_nm == pytest.approx(111.0, rel=0.01)
    assert scale.excitation_hz == (0.5, 1.0, 3.0, 6.0, 9.0)
    assert scale.lines_hz == (50.0,)
    assert scale.step_s == pytest.approx(1e-3)


def test_clean_data_ask_for_the_sharpest_filter() -> None:
    of = traces()
    assert best_rho(of, PLAIN, {}, first_guess(of, PLAIN)).rho == 0.0


def test_the_shortlist_has_the_best_and_no_more_than_asked_for() -> None:
    of = traces("cubic_stiffness")
    screen = Screen(of, PLAIN, {}, first_guess(of, PLAIN))
    looks = screen.all(["cubic_stiffness", "backlash", "quadratic_stiffness", "coulomb_friction", "creep"])
    short = screen.shortlist(looks, 3)
    assert len(short) <= 3
    assert looks[0].effect in {s.effect for s in short}


def test_without_torque_the_scale_comes_from_the_motion() -> None:
    guess = first_guess(traces_of(Recording((decay_run(Platform(0.5, 0.1, 20.0)),))), PLAIN)
    assert guess.platform[0] == 1.0
    assert guess.platform[2] == pytest.approx(40.0, rel=1e-2)
