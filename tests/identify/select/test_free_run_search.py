"""The search over whole runs: what it names near the data, and when it leaves the field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select import fitter
from identify.select.candidates import Candidates
from identify.select.free_run_search import FineSearch
from identify.select.search_state import Search
from rig import effects
from rig.recording.run import Recording
from tests.identify.simulated import NOISE_RAD_S, SETS, TRUTH, campaign, sine_run, traces_of

START: dict[Name, float] = {("inertia",): 0.0201, ("damping",): 0.05, ("stiffness",): 676.0}
ALLOWED = (
    "coulomb_friction", "stribeck_friction", "cubic_stiffness", "quadratic_stiffness", "torque_delay",
    "actuator_lag", "sensor_lag", "creep", "torque_offset", "rate_bias", "directional_damping",
)  # fmt: skip


def offered(recording: Recording, allowed: tuple[str, ...] = ALLOWED) -> FineSearch:
    traces = traces_of(recording)
    return FineSearch(Candidates(traces, split(traces), allowed), lambda text: None)


def searched(
    recording: Recording, allowed: tuple[str, ...] = ALLOWED, start: Mapping[Name, float] = START
) -> tuple[Search, bool]:
    fine = offered(recording, allowed)
    begin = fine.whole(Structure(), start)
    assert begin is not None
    found = Search(begin.judged(), begin.judged(), 0.1, fine.noise)
    return found, fine.take_over(found)


@pytest.mark.parametrize(
    ("hidden", "named"),
    [
        ({}, ()),
        ({"coulomb_friction": {"level": 0.05}}, ("coulomb_friction",)),
        ({"torque_delay": {"delay": 2e-5}}, ("torque_delay",)),
        ({"cubic_stiffness": {"factor": 300.0}, "coulomb_friction": {"level": 0.1}},
         ("coulomb_friction", "cubic_stiffness")),
    ],
)  # fmt: skip
def test_small_effects_are_named_and_nothing_besides(
    hidden: Mapping[str, Mapping[str, float]], named: tuple[str, ...]
) -> None:
    found, took = searched(campaign(hidden, duration_s=4))
    assert took
    assert set(found.best.structure.effects) == set(named)
    assert found.best.sigma < 1.1 * NOISE_RAD_S


def test_what_leaves_a_third_of_what_was_missing_is_not_believed_before_the_rest_is_there() -> None:
    hidden = campaign({"quadratic_damping": {"factor": 1.4e-4}, "coulomb_friction": {"level": 0.0012}}, duration_s=4)
    found, took = searched(hidden, ("coulomb_friction",))
    assert not took
    assert found.best.structure.effects == ()
    found, took = searched(hidden, ("coulomb_friction", "quadratic_damping"))
    assert took
    assert set(found.best.structure.effects) == {"coulomb_friction", "quadratic_damping"}


@pytest.mark.parametrize(
    ("level", "added", "declared", "believed"),
    [
        (1.2, ("cubic_stiffness",), (), True),
        (1.2, ("cubic_stiffness", "creep"), (), False),
        (1.05, ("cubic_stiffness", "creep"), (), True),
        (1.2, ("cubic_stiffness",), ("creep",), True),
    ],
)
def test_what_can_follow_anything_has_to_bring_the_model_to_the_noise(
    level: float, added: tuple[str, ...], declared: tuple[str, ...], believed: bool
) -> None:
    traces = traces_of(campaign(sets=((67.0, 6.0),), duration_s=1))
    fine = FineSearch(Candidates(traces, split(traces), ()), lambda text: None)
    fine.declared_level = 1000.0
    plain = fine.whole(Structure(), START)
    assert plain is not None
    estimate = replace(plain.estimate, structure=Structure(effects=(*declared, *added)))
    assert fine._believed(replace(plain, estimate=estimate, squares=level * plain.count), declared) is believed


def test_a_lag_of_the_sensor_is_named_in_the_drive_which_no_record_tells_from_it() -> None:
    found, took = searched(campaign({"sensor_lag": {"time": 3e-4}}, duration_s=4))
    assert took
    assert found.best.structure.effects == ("actuator_lag",)
    assert "sensor_lag" in (effects.get("actuator_lag").never_separable or {})


@pytest.mark.slow
def test_what_no_candidate_brings_down_to_the_noise_is_left_to_others_untouched() -> None:
    found, took = searched(campaign({"hysteresis": {"level": 1.0, "yield_angle": 0.05, "exponent": 1.5, "share": 0.5}}))
    assert not took
    assert found.best.structure.effects == ()
    assert found.candidates == []


def test_a_record_far_above_the_sensors_noise_is_left_to_others() -> None:
    recording = campaign({"coulomb_friction": {"level": 1.0}}, duration_s=4)
    quiet = replace(recording, noise=1e-7)
    found, took = searched(quiet)
    assert not took
    assert found.best.structure.effects == ()


def test_a_second_inertia_as_heavy_as_the_platform_is_found_though_nothing_runs_near_without_it() -> None:
    mode = {"inertia": 0.021, "frequency": 24.0, "ratio": 0.006}
    recording = campaign({"flexible_mode": mode}, duration_s=4)
    found, took = searched(recording, ("coulomb_friction", "torque_delay", "flexible_mode"))
    assert found.base.sigma > 100.0 * NOISE_RAD_S
    assert took
    assert found.best.structure.effects == ("flexible_mode",)
    assert found.best.sigma < 1.1 * NOISE_RAD_S
    values = found.best.values()
    assert [values["flexible_mode", n] for n in mode] == pytest.approx(list(mode.values()), rel=1e-3)
    assert [values[n,] for n in ("inertia", "stiffness")] == pytest.approx([TRUTH[0], TRUTH[2]], rel=1e-3)


def test_a_tone_that_the_model_without_it_took_for_the_resonance_is_named_and_the_inertia_right() -> None:
    tone = {"sine": 4.0, "cosine": 1.0, "frequency": 46.0}
    recording = campaign({"periodic_disturbance": tone}, duration_s=3, sets=((111.0, 1.0), (104.0, 3.0), (67.0, 6.0)))
    lost = START | {("inertia",): TRUTH[2] / (2.0 * np.pi * tone["frequency"]) ** 2}
    found, took = searched(recording, ("coulomb_friction", "periodic_disturbance", "cubic_stiffness"), lost)
    assert found.base.values()["inertia",] < 0.5 * TRUTH[0]
    assert took
    assert found.best.structure.effects == ("periodic_disturbance",)
    assert found.best.sigma < 1.1 * NOISE_RAD_S
    values = found.best.values()
    assert values["periodic_disturbance", "frequency"] == pytest.approx(46.0, rel=1e-6)
    assert [values[n,] for n in ("inertia", "damping", "stiffness")] == pytest.approx(TRUTH, rel=1e-4)


def test_a_resonance_that_a_fit_has_missed_is_looked_for_elsewhere() -> None:
    traces = traces_of(
        campaign({"flexible_mode": {"inertia": 0.0012, "frequency": 58.0, "ratio": 0.038}}, duration_s=3)
    )
    on_offer = Candidates(traces, split(traces), ("flexible_mode",))
    lost = {"inertia": 7.7e-5, "frequency": 21.0, "ratio": 0.05}
    begin = START | {("flexible_mode", n): v for n, v in lost.items()}
    missed = on_offer.fits.whole(Structure(effects=("flexible_mode",)), begin)
    assert missed is not None and missed.level > 2.0
    found = on_offer.fits.elsewhere(missed, "flexible_mode")
    assert found.squares < 0.5 * missed.squares
    assert found.values()["flexible_mode", "frequency"] == pytest.approx(58.0, rel=0.05)


def test_a_search_that_led_nowhere_is_not_begun_again_from_where_it_passed() -> None:
    traces = traces_of(campaign({"coulomb_friction": {"level": 0.5}}, duration_s=2))
    fine = FineSearch(Candidates(traces, split(traces), ALLOWED), lambda text: None)
    model = fine.whole(Structure(), START)
    assert model is not None and fine._near(model, 0.5)
    fine.passed[frozenset()] = model.level
    assert not fine._near(model, 0.5)
    fine.passed[frozenset()] = 2.0 * model.level
    assert fine._near(model, 0.5)


def test_of_two_effects_that_no_record_parts_one_is_dropped_however_large_both_are() -> None:
    traces = traces_of(campaign({"cubic_stiffness": {"factor": 3000.0}}, duration_s=3))
    fine = FineSearch(Candidates(traces, split(traces), (*ALLOWED, "unbalance")), lambda text: None)
    begin = dict(zip(START, TRUTH, strict=True)) | {("cubic_stiffness", "factor"): 2990.0}
    begin |= {("unbalance", "sine"): -60.0, ("unbalance", "cosine"): 0.0, ("stiffness",): TRUTH[2] + 60.0}
    both = fine.whole(Structure(effects=("unbalance", "cubic_stiffness")), begin)
    assert both is not None and both.level < 1.1
    found = Search(both.judged(), both.judged(), 0.1, fine.noise)
    left = fine.pruning.pruned(found, both, both.structure.effects)
    assert left.structure.effects == ("cubic_stiffness",)
    assert left.level < 1.1
    assert left.values()["stiffness",] == pytest.approx(TRUTH[2], rel=1e-3)


def test_gravity_is_not_kept_beside_the_softening_spring_that_it_was_taken_for() -> None:
    traces = traces_of(campaign({"cubic_stiffness": {"factor": 2000.0}}, duration_s=3))
    fine = FineSearch(Candidates(traces, split(traces), ("cubic_stiffness", "unbalance")), lambda text: None)
    alone = fine.whole(Structure(), START)
    begin = dict(zip(START, TRUTH, strict=True)) | {("cubic_stiffness", "factor"): 2010.0, ("stiffness",): 3077.3}
    begin |= {("unbalance", "sine"): -2400.0, ("unbalance", "cosine"): 0.0}
    both = fine.whole(Structure(effects=("unbalance", "cubic_stiffness")), begin)
    assert alone is not None and both is not None and both.level < 1.1
    assert both.values()["stiffness",] > 2.0 * TRUTH[2]
    found = Search(alone.judged(), both.judged(), 0.1, fine.noise)
    left = fine.pruning.pruned(found, both, both.structure.effects)
    assert left.structure.effects == ("cubic_stiffness",)
    assert left.values()["stiffness",] == pytest.approx(TRUTH[2], rel=1e-3)


def test_a_light_sharp_mode_above_all_torque_is_found_by_its_ring_where_runs_begin() -> None:
    mode = {"inertia": 0.0007, "frequency": 84.0, "ratio": 0.0076}
    recording = campaign({"flexible_mode": mode}, duration_s=2, noise=np.radians(0.02), sets=SETS[2:])
    found, took = searched(replace(recording, noise=None), ("coulomb_friction", "flexible_mode"))
    assert took
    assert found.best.structure.effects == ("flexible_mode",)
    assert found.best.values()["flexible_mode", "frequency"] == pytest.approx(84.0, rel=0.02)


@pytest.mark.parametrize("level", [3.0, 8.0])
def test_friction_that_holds_the_platform_is_coulombs_though_far_off_every_score_points_elsewhere(
    level: float,
) -> None:
    """At 3 N m Stribeck's finds the noise first and has nothing of its own; at 8 only presliding scores at all."""
    kinds = ("coulomb_friction", "stribeck_friction", "presliding_friction", "load_dependent_friction")
    found, took = searched(campaign({"coulomb_friction": {"level": level}}, duration_s=2), kinds)
    assert found.base.sigma > 400.0 * NOISE_RAD_S
    assert took
    assert found.best.structure.effects == ("coulomb_friction",)
    assert found.best.sigma < 1.1 * NOISE_RAD_S
    assert found.best.values()["coulomb_friction", "level"] == pytest.approx(level, rel=1e-3)


def test_held_out_runs_take_no_part_in_the_fit() -> None:
    recording = campaign({"coulomb_friction": {"level": 0.1}}, duration_s=4)
    runs = [replace(r, use="holdout" if i == 4 else "fit") for i, r in enumerate(recording.runs)]
    runs[4].rate_rad_s[:] += 0.5 * np.sin(runs[4].time_s)  # type: ignore[index]
    found, took = searched(Recording(tuple(runs)), ("coulomb_friction",))
    level = found.best.values().get(("coulomb_friction", "level"))
    assert not took or level == pytest.approx(0.1, rel=0.05)


def test_every_name_it_may_try_is_an_effect() -> None:
    assert set(ALLOWED) <= set(effects.names())


def test_a_search_that_has_cost_too_much_goes_on_only_where_the_noise_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = campaign({"cubic_stiffness": {"factor": 300.0}, "coulomb_friction": {"level": 0.1}}, duration_s=4)
    monkeypatch.setattr(fitter, "MOST_SIMULATIONS", 100)
    found, took = searched(hidden)
    assert not took  # the first candidates have cost that, and leave thirty times the noise's variance
    assert found.best.structure.effects == ()
    found, took = searched(campaign({"coulomb_friction": {"level": 0.002}}, duration_s=4))
    assert took
    assert found.best.structure.effects == ("coulomb_friction",)


def test_a_decay_is_searched_however_much_it_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitter, "MOST_SIMULATIONS", 0)
    torque_free = [replace(t, torque=None) for t in traces_of(campaign(duration_s=1))]
    offer = Candidates(torque_free, split(torque_free), ALLOWED)
    astray = offer.fits.whole(Structure(), {**START, ("stiffness",): 200.0}, steps=1)
    assert astray is not None
    assert astray.level > 100.0
    assert not offer.fits.gives_up(astray)


@pytest.mark.slow
def test_a_lag_that_two_slow_soft_sines_cannot_tell_from_a_delay_stands_beside_it() -> None:
    """The tangent at no lag asks for a negative damping, from which no fit of a lag finds its way."""
    slow = [
        sine_run(100.0, f, effects={"sensor_lag": {"time": 2e-3}}, duration_s=6.0, soft_s=1.0, seed=1)
        for f in (1.0, 3.0)
    ]
    found, took = searched(Recording(tuple(slow)), start={**START, ("damping",): 1.4})
    assert took
    (name,) = found.best.structure.effects
    lags = {"actuator_lag", "sensor_lag", "torque_delay"}
    assert name in lags
    assert lags - {name} <= set(found.rivals[name])


def test_friction_of_which_a_model_that_never_stuck_sees_a_sixth_is_found() -> None:
    """Slow sines from a standstill beside the spring's rest: the ring hides what friction does between its stops."""
    hidden, level = {"coulomb_friction": {"level": 1.2}}, 1.2
    slow = [
        sine_run(m, f, effects=hidden, duration_s=10.0, begin_rad=b * level / TRUTH[2], seed=i)
        for i, (m, f, b) in enumerate(((80.0, 0.3, 0.6), (80.0, 0.9, -0.7)))
    ]
    found, took = searched(Recording(tuple(slow)))
    assert took
    assert found.best.structure.effects == ("coulomb_friction",)
    assert found.best.values()["coulomb_friction", "level"] == pytest.approx(level, rel=1e-3)


def test_a_declared_twin_is_begun_from_its_own_numbers_where_the_search_came_by_other_ones() -> None:
    hidden = {"coulomb_friction": {"level": 1.2}}
    truth: dict[Name, float] = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}
    truth[("coulomb_friction", "level")] = 1.2
    traces = traces_of(campaign(hidden, sets=((104.0, 3.0), (42.0, 9.0)), duration_s=3))
    structure = Structure(effects=("coulomb_friction",))
    lost = {**truth, ("stiffness",): 60.0, ("inertia",): 0.3, ("coulomb_friction", "level"): 0.0}
    for declared, near in ((None, False), (truth, True)):
        fine = FineSearch(Candidates(traces, split(traces), (), structure.effects), lambda text: None, declared)
        begin = fine.whole(structure, lost, steps=0)
        assert begin is not None
        found = Search(begin.judged(), begin.judged(), 0.1, fine.noise)
        fitted = fine._begin(found)
        assert fitted is not None
        assert (fitted.level < 1.1) is near


def test_a_known_mass_has_the_torque_scale_tried_though_others_promise_more() -> None:
    runs = []
    for added in (0.0, 0.01):
        jck = ((TRUTH[0] + added) * 1.05, TRUTH[1] * 1.05, TRUTH[2] * 1.05)  # as if a torque 5 % too small acted
        mine = [sine_run(m, f, effects={"coulomb_friction": {"level": 1.05 * 0.5}}, jck=jck) for m, f in SETS[:3]]
        runs += [replace(r, name=f"{r.name}, {added:g}", added_inertia_kg_m2=added) for r in mine]
    offer = offered(Recording(tuple(runs)), (*ALLOWED, "torque_scale", "cogging", "torque_saturation")).on_offer
    now = offer.fits.whole(Structure(effects=("coulomb_friction",)), {**START, ("coulomb_friction", "level"): 0.5})
    assert now is not None
    tried, _ = offer.tried(now)
    assert tried["torque_scale"].at_noise


def test_gravity_found_beside_another_effect_is_asked_against_the_spring_that_it_may_be() -> None:
    traces = traces_of(campaign({"cubic_stiffness": {"factor": 3000.0}}, duration_s=3))
    fine = FineSearch(Candidates(traces, split(traces), ("cubic_stiffness", "unbalance")), lambda text: None)
    alone = fine.whole(Structure(), START)
    begin = dict(zip(START, TRUTH, strict=True)) | {("stiffness",): TRUTH[2] + 18000.0}
    begin |= {("unbalance", "sine"): -18000.0, ("unbalance", "cosine"): 0.0}
    gravity = fine.whole(Structure(effects=("unbalance",)), begin)
    assert alone is not None and gravity is not None and gravity.level < 2.0
    found = Search(alone.judged(), gravity.judged(), 0.1, fine.noise)
    left = fine._asked_again(found, gravity, 0)
    assert left.structure.effects == ("cubic_stiffness",)
    assert left.values()["cubic_stiffness", "factor"] == pytest.approx(3000.0, rel=1e-2)
    assert left.values()["stiffness",] == pytest.approx(TRUTH[2], rel=1e-3)


def test_a_declared_twin_that_leads_nowhere_leaves_the_search_as_it_was() -> None:
    hysteresis = {"hysteresis": {"level": 1.0, "yield_angle": 0.05, "exponent": 1.5, "share": 0.5}}
    traces = traces_of(campaign(hysteresis, sets=((104.0, 3.0), (42.0, 9.0)), duration_s=2))
    structure = Structure(effects=("coulomb_friction",))
    declared: dict[Name, float] = dict(zip(START, TRUTH, strict=True)) | {("coulomb_friction", "level"): 0.2}
    fine = FineSearch(Candidates(traces, split(traces), (), structure.effects), lambda text: None, declared)
    begin = fine.whole(structure, {**declared, ("stiffness",): 60.0, ("inertia",): 0.3}, steps=0)
    assert begin is not None
    found = Search(begin.judged(), begin.judged(), 0.1, fine.noise)
    base, best = found.base, found.best
    assert not fine.take_over(found)
    assert fine.twin is not None
    assert found.base is base
    assert found.best is best
