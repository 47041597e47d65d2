"""Measured channels as causes: named where they are one, silent where they are not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from identify.pipeline import identify
from identify.results import Identification
from identify.runs.measured_channels import offer_of, with_causes
from identify.signals.channel_readings import lost, table_of
from identify.signals.prepare import prepare
from rig import effects
from rig.channels import Channel
from rig.config.identify import IdentifyConfig
from rig.config.model import ModelConfig
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.errors import RecordingError
from rig.platform import TERMS, Platform
from rig.recording.run import Recording, Run
from tests.identify.channel_rigs import NOISE_RAD_S, PAUSE_S, TRUTH, C, J, K, played, random_walk, sagging

WINDING = Channel("winding", "temperature")
OTHER_AXIS = Channel("other_axis", "acceleration")
RIVALS = ("stiffness_drift", "creep", "torque_saturation", "actuator_lag", "periodic_disturbance", "coulomb_friction")
TIME = np.arange(2001) * 1e-3


def warming(t: float) -> float:
    return 21.0 + 30.0 * (1.0 - math.exp(-t / 20.0))


def swinging(t: float) -> float:
    """Acceleration of another axis in rad/s^2."""
    return 14.0 * math.sin(2.0 * math.pi * 4.3 * t) + 9.0 * math.cos(2.0 * math.pi * 13.7 * t)


def cycling(t: float) -> float:
    return 21.0 + 8.0 * math.sin(2.0 * math.pi * t / 17.0)


def weakening_magnet(seed: int = 0) -> Recording:
    return played(WINDING, warming, shaft=lambda t, m, w: m * (1.0 - 0.002 * (warming(t) - 21.0)), seed=seed)


def coupled(seed: int = 0) -> Recording:
    load = lambda t, th, w: 0.01 * swinging(t)  # noqa: E731
    return played(OTHER_AXIS, swinging, load=load, reading_noise=0.05, seed=seed)


def softening(seed: int = 0, duration_s: float = 2.5) -> Recording:
    bends = lambda t, th, w: -0.8 * (cycling(t) - 21.0) * th  # noqa: E731
    return played(WINDING, cycling, load=bends, seed=seed, duration_s=duration_s)


def of_channel(channel: Channel) -> tuple[str, ...]:
    effects.declare_channels([channel])
    return effects.of_channel(channel.name)


def identified(recording: Recording, *, library: tuple[str, ...] | None = RIVALS) -> Identification:
    """With the library's rivals and all ways of the channel, or with the whole library."""
    channel = next(iter(recording.runs[0].causes.values()))
    candidates = None if library is None else [*library, *of_channel(channel)]
    return identify(recording, Platform(), IdentifyConfig.model_validate({"candidates": candidates}))


@cache
def of_the_magnet() -> Identification:
    return identified(weakening_magnet())


@cache
def of_the_spring() -> Identification:
    return identified(softening(duration_s=2.0))


def assert_terms(found: Identification, relative: float = 0.001) -> None:
    """Within a tenth of a percent (damping: one), and within five standard errors that are not wide either."""
    for term, truth in zip(TERMS, TRUTH, strict=True):
        estimate = found.final.parameters[term]
        assert estimate.value == pytest.approx(truth, rel=relative if term != "damping" else 0.01)
        assert estimate.std_error < 0.005 * truth
        assert abs(estimate.value - truth) < 5.0 * estimate.std_error


def assert_number(found: Identification, effect: str, parameter: str, truth: float) -> None:
    estimate = found.final.effect_parameters[effect][parameter]
    assert estimate.value == pytest.approx(truth, rel=0.01)
    assert 0.0 < estimate.std_error < 0.01 * abs(truth)
    assert abs(estimate.value - truth) < 5.0 * estimate.std_error


@pytest.mark.slow
def test_a_winding_that_warms_is_named_as_what_lowers_the_torque_with_its_slope() -> None:
    found = of_the_magnet()
    assert found.accepted, found.reasons
    assert found.verdict.effects == ("winding_gain",)
    assert_number(found, "winding_gain", "slope", -0.002)
    assert found.final.effect_parameters["winding_gain"]["slope"].unit == "1/K"
    assert_terms(found)


@pytest.mark.slow
@pytest.mark.parametrize("identification", [of_the_spring, of_the_magnet])
def test_the_verdict_says_at_which_temperature_the_parameters_hold(
    identification: Callable[[], Identification],
) -> None:
    said = [s for s in identification().verdict.sentences if "is relative to" in s]
    assert len(said) == 1
    assert float(said[0].split("is relative to ")[1].split(":")[0]) == pytest.approx(21.0, abs=0.02)


@pytest.mark.slow
def test_another_axis_that_accelerates_is_named_and_its_coupling_measured() -> None:
    found = identified(coupled())
    assert found.accepted, found.reasons
    assert found.verdict.effects == ("other_axis_torque",)
    assert_number(found, "other_axis_torque", "slope", 0.01)
    assert_terms(found)


@pytest.mark.slow
def test_a_spring_that_softens_with_temperature_is_told_from_one_that_drifts() -> None:
    found = of_the_spring()
    assert found.accepted, found.reasons
    assert found.verdict.effects == ("winding_stiffness",)
    assert_number(found, "winding_stiffness", "slope", -0.8)
    assert not found.verdict.confusable_with["winding_stiffness"]
    assert_terms(found)


@pytest.mark.slow
def test_the_noise_of_a_measured_current_pushes_the_platform_and_bends_no_value() -> None:
    """White noise of 0.005 A, 12 mN m, makes a platform that rings as this one swing by ten times the gyro's noise."""
    found = identified(sagging(2.5, reading_noise=0.005))
    assert found.verdict.effects == ("motor_current_drive",)
    assert_number(found, "motor_current_drive", "share", 1.0)
    assert_terms(found)


@pytest.mark.slow
def test_the_measured_current_takes_the_place_of_the_torque_asked_of_a_drive_that_sags() -> None:
    found = identified(sagging(2.5, reading_noise=0.0001, duration_s=2.0))
    assert found.accepted, found.reasons
    assert found.verdict.effects == ("motor_current_drive",)
    assert_number(found, "motor_current_drive", "share", 1.0)
    assert_terms(found)


@pytest.mark.slow
def test_where_channel_and_library_do_as_well_the_library_is_named_and_the_channel_stands_beside_it() -> None:
    """A temperature that rises evenly within one run is time itself."""
    even = lambda t: 21.0 + 0.7 * t  # noqa: E731
    recording = played(
        WINDING, even, load=lambda t, th, w: -2.0 * t * th, sets=((3.0, 70.0),), duration_s=8.0, reading_noise=0.002
    )
    found = identified(recording)
    assert found.verdict.effects == ("stiffness_drift",)
    assert "winding_stiffness" in found.verdict.confusable_with["stiffness_drift"]
    assert found.final.effect_parameters["stiffness_drift"]["slope"].value == pytest.approx(-2.0, rel=0.01)


@pytest.mark.slow
def test_a_temperature_that_wanders_is_not_named_on_clean_data() -> None:
    found = identified(played(WINDING, random_walk(7), reading_noise=0.0, duration_s=2.0))
    assert found.accepted, found.reasons
    assert found.verdict.effects == ()
    tried = {c.effect for c in found.verdict.candidates}
    assert {"winding_gain", "winding_stiffness"} <= tried


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_beside_the_whole_library_a_temperature_that_acts_on_nothing_stays_unnamed(seed: int) -> None:
    found = identified(played(WINDING, random_walk(seed), reading_noise=0.0, seed=seed), library=None)
    assert found.verdict.effects == ()
    assert not found.verdict.unexplained


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_beside_the_whole_library_a_temperature_that_acts_on_nothing_displaces_no_true_effect(seed: int) -> None:
    cubic = lambda t, th, w: 900.0 * th**3  # noqa: E731
    recording = played(WINDING, random_walk(seed), load=cubic, reading_noise=0.0, seed=seed)
    found = identified(recording, library=None)
    without = identify(
        replace(recording, runs=tuple(replace(r, causes={}, channels={}) for r in recording.runs)), Platform(),
        IdentifyConfig(),
    )  # fmt: skip
    assert found.verdict.effects == without.verdict.effects == ("cubic_stiffness",)
    assert not any(r.startswith("winding") for r in found.verdict.confusable_with["cubic_stiffness"])
    assert found.final.parameters == without.final.parameters


@pytest.mark.slow
@pytest.mark.parametrize("made", [weakening_magnet, coupled, softening], ids=lambda f: f.__name__)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_beside_the_whole_library_the_channel_that_acts_is_named(made: object, seed: int) -> None:
    assert callable(made)
    found = identified(made(seed), library=None)
    named = {"weakening_magnet": "winding_gain", "coupled": "other_axis_torque", "softening": "winding_stiffness"}
    assert found.verdict.effects == (named[made.__name__],)
    assert found.accepted, found.reasons
    assert_terms(found)


# -- what may be a cause at all ------------------------------------------------------------------


def swing(channels: dict[str, np.ndarray], causes: dict[str, Channel], name: str = "run") -> Run:
    """Two tones, so that angle and rate of one are not the acceleration of another."""
    rng = np.random.default_rng(3)
    rate = 0.4 * np.cos(20.0 * TIME) + 0.3 * np.cos(57.0 * TIME)
    return Run(
        name, TIME, np.ones(len(TIME), dtype=bool), rate_rad_s=rate + NOISE_RAD_S * rng.normal(size=len(TIME)),
        torque_time_s=TIME, torque_nm=10.0 * np.sin(20.0 * TIME), channels=channels, causes=causes,
    )  # fmt: skip


def offered(*runs: Run, declared: Platform | None = None) -> tuple[tuple[str, ...], dict[str, str]]:
    declared = declared or Platform()
    offer = offer_of([prepare(r, i) for i, r in enumerate(with_causes(runs, declared, {}))], declared)
    return offer.candidates, {c.effect: c.status for c in offer.refused} | dict(offer.idle)


def test_the_platforms_own_acceleration_is_refused_as_a_cause_by_name() -> None:
    own = -8.0 * np.sin(20.0 * TIME) - 17.1 * np.sin(57.0 * TIME)
    candidates, refused = offered(swing({"x": own}, {"x": Channel("x", "acceleration")}))
    assert candidates == ()
    assert refused["x_torque"].startswith("refused: 9")
    assert "the platform's own motion" in refused["x_torque"]


def test_a_measured_torque_may_drive_but_is_no_torque_of_its_own_on_the_same_shaft() -> None:
    slow, fast = 20.0 * TIME, 57.0 * TIME
    angle = 0.02 * np.sin(slow) + 0.3 / 57.0 * np.sin(fast)
    rate, acceleration = 0.4 * np.cos(slow) + 0.3 * np.cos(fast), -8.0 * np.sin(slow) - 17.1 * np.sin(fast)
    shaft = J * acceleration + C * rate + K * angle
    candidates, refused = offered(swing({"cell": shaft}, {"cell": Channel("cell", "torque")}))
    assert candidates == ("cell_drive",)
    assert "own motion" in refused["cell_torque"]


def test_a_channel_that_stands_still_or_is_missing_in_a_run_is_no_cause() -> None:
    still, warm = np.full(len(TIME), 23.0), 23.0 + TIME**2
    x = {"x": Channel("x", "temperature")}
    assert "is constant at 23.000 in all runs" in offered(swing({"x": still}, x))[1]["x_gain"]
    assert offered(swing({"x": warm}, x))[0] == ("x_gain", "x_stiffness", "x_damping", "x_friction")
    both = offered(swing({"x": warm}, x), swing({}, {}, "cold.csv"))
    assert both[0] == ()
    assert "cold.csv has no x" in both[1]["x_gain"]


def test_a_channel_that_no_run_has_is_told_with_those_there_are() -> None:
    asked = IdentifyConfig.model_validate({"channels": {"wnding": {"kind": "temperature"}}}).channels
    runs = with_causes([swing({"winding": 23.0 + TIME**2}, {})], Platform(J, C, K), asked)
    offer = offer_of([prepare(r, i) for i, r in enumerate(runs)], Platform(J, C, K), asked)
    assert offer.candidates == ()
    assert {c.status for c in offer.refused} == {
        "refused: no run has a channel 'wnding'; there are: winding (recorded.columns.channels)"
    }


def test_a_declared_effect_of_a_channel_that_stands_still_is_set_aside_with_a_reason() -> None:
    model = ModelConfig.model_validate({
        "channels": {"x": {"kind": "temperature", "reference": 21.0}}, "effects": {"x_gain": {"slope": -0.01}}
    })  # fmt: skip
    still = np.full(len(TIME), 23.0)
    candidates, idle = offered(swing({"x": still}, {}), declared=model.platform())
    assert candidates == ()
    assert idle["x_gain"] == "x is constant at 23.000 in all runs; J, C and K hold for that value"


def test_a_model_that_reads_a_channel_is_refused_where_a_run_does_not_have_it() -> None:
    model = ModelConfig.model_validate({
        "channels": {"winding": {"kind": "temperature", "reference": 21.0}},
        "effects": {"winding_gain": {"slope": -0.002}},
    })  # fmt: skip
    with pytest.raises(RecordingError, match=r"model\.effects\.winding_gain reads the channel 'winding', which run"):
        with_causes([swing({}, {})], model.platform(), {})
    as_angle = swing({"winding": 0.1 * TIME}, {"winding": Channel("winding", "angle")})
    with pytest.raises(RecordingError, match=r"model\.channels\.winding\.kind is temperature"):
        with_causes([as_angle], model.platform(), {})


def test_the_reference_of_the_model_stands_and_else_the_first_reading_of_the_first_run() -> None:
    warm = {"winding": 23.0 + TIME}
    found = with_causes([swing(warm, {"winding": WINDING})], Platform(), {})[0].causes["winding"]
    assert found.reference == pytest.approx(23.0, abs=1e-6)
    declared = Platform(channels={"winding": replace(WINDING, reference=21.0)})
    assert with_causes([swing(warm, {"winding": WINDING})], declared, {})[0].causes["winding"].reference == 21.0


def test_the_torque_of_an_ampere_comes_from_the_record_and_a_sag_does_not_bend_it() -> None:
    torque = 10.0 * np.sin(20.0 * TIME)
    current = np.where(np.abs(torque) > 8.0, 0.9, 1.0) * torque / 2.5
    found = with_causes([swing({"i": current}, {"i": Channel("i", "current")})], Platform(), {})
    assert found[0].causes["i"].factor == pytest.approx(2.5, rel=1e-4)


# -- what a channel reads ------------------------------------------------------------------------


def test_between_samples_a_fast_channel_is_right_to_a_ten_thousandth() -> None:
    tone = np.sin(2.0 * np.pi * 29.0 * TIME)
    table, per_s = table_of(swing({"x": tone}, {}), Channel("x", "acceleration", "", 0.0, 1.0), 1e-3)
    middle = np.arange(200, 1700) * 1.1e-3
    read = np.interp(middle, np.arange(len(table)) / per_s, table)
    assert np.max(np.abs(read - np.sin(2.0 * np.pi * 29.0 * middle))) < 1e-4


def test_a_thermometer_read_once_in_a_while_is_joined_by_straight_lines() -> None:
    slow = np.full(len(TIME), np.nan)
    slow[::500] = 20.0 + 2.0 * TIME[::500]
    run = swing({"x": slow}, {"x": Channel("x", "temperature", "", 20.0, 1.0)})
    assert not lost(run).any()
    table, per_s = table_of(run, run.causes["x"], 1e-3)
    np.testing.assert_allclose(table, 2.0 * np.arange(len(table)) / per_s, atol=1e-9)


def test_the_noise_of_a_thermometer_does_not_act() -> None:
    noisy = 20.0 + 0.1 * np.random.default_rng(1).normal(size=len(TIME))
    table, _ = table_of(swing({"x": noisy}, {}), Channel("x", "temperature", "", 20.0, 1.0), 1e-3)
    assert np.std(table) < 0.02


def test_readings_lost_for_long_take_their_samples_out_and_short_losses_are_bridged() -> None:
    gappy = swinging_along()
    gappy[300:330] = np.nan
    gappy[800:1000] = np.nan
    run = swing({"x": gappy}, {"x": Channel("x", "acceleration", "", 0.0, 1.0)})
    assert lost(run).sum() == 200
    keep = prepare(run).keep
    assert not keep[800:1000].any()
    assert keep[300:330].all()


def swinging_along() -> np.ndarray:
    return np.array([swinging(float(t)) for t in TIME])


class Straight:
    """A channel that is one throughout a run."""

    def table(self, channel: Channel) -> tuple[np.ndarray, float, float]:
        return np.ones(2), 1.0, 0.0


@pytest.mark.parametrize(
    ("name", "same_as"),
    [
        ("probe_stiffness", Platform(J, C, K + 5.0)), ("probe_damping", Platform(J, C + 5.0, K)),
        ("probe_torque", Platform(J, C, K, {"torque_offset": {"level": 5.0}})),
        ("probe_friction", Platform(J, C, K, {"coulomb_friction": {"level": 5.0}})),
    ],
)  # fmt: skip
def test_a_channel_that_stands_at_one_acts_as_the_term_that_it_changes(name: str, same_as: Platform) -> None:
    effects.declare_channels([Channel("probe", "other", reference=0.0, factor=1.0)])
    torque = np.tile(40.0 * np.sin(6.0 * TIME[:-1])[:, None], (1, 3))
    changed = Equations(Platform(J, C, K, {name: {"slope": 5.0}})).integrate(torque, 1e-3, (0.0, 0.0), Straight())
    expected = Equations(same_as).integrate(torque, 1e-3, (0.0, 0.0))
    np.testing.assert_allclose(changed[:, :2], expected[:, :2], atol=1e-9)


def test_without_a_recording_a_channel_stands_at_its_reference_and_its_effects_do_nothing() -> None:
    effects.declare_channels([Channel("probe", "other", reference=3.0, factor=1.0)])
    signal = TorqueSignal(TIME, 40.0 * np.sin(6.0 * TIME))
    plain = simulate(Platform(J, C, K), TIME, signal)
    for name in effects.of_channel("probe"):
        twin = simulate(Platform(J, C, K, {name: {"slope": 5.0}}), TIME, signal)
        np.testing.assert_allclose(twin.rate_rad_s, plain.rate_rad_s, atol=1e-7)


def test_sets_follow_one_another_and_stay_warm() -> None:
    recording = weakening_magnet()
    means = [float(np.mean(r.channels["winding"])) for r in recording.runs]
    assert means[1] - means[0] > 0.2 * PAUSE_S
