"""The residual in torque: its differentiator, its low-pass, and what is left at the true parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from identify.diagnose.torque_residual import motion, relative, torque_noise_floor, torque_residual
from identify.estimate.output_error import Name
from identify.model.structure import Structure
from identify.signals.low_pass import low_pass
from identify.signals.prepare import prepare
from rig.recording.run import Run
from tests.identify.simulated import TRUTH, campaign, sine_run, traces_of
from tests.rig.effects.values import VALUES

TIME = np.arange(4001) * 1e-3
RING = 2 * np.pi * 29.0
JCK: dict[Name, float] = {("inertia",): TRUTH[0], ("damping",): TRUTH[1], ("stiffness",): TRUTH[2]}


def amplitude(x: np.ndarray) -> float:
    """Amplitude of the 29 Hz part, the ends left out."""
    inside = slice(500, 3500)
    basis = np.stack([np.sin(RING * TIME), np.cos(RING * TIME), np.ones_like(TIME), TIME], axis=1)[inside]
    return float(np.hypot(*np.linalg.lstsq(basis, x[inside], rcond=None)[0][:2]))


@pytest.mark.parametrize("channel", ["rate", "angle"])
def test_at_the_ring_the_differentiators_are_off_by_less_than_a_twentieth_of_a_percent(channel: str) -> None:
    ok = np.ones(len(TIME), bool)
    gyro = Run("ring", TIME, ok, rate_rad_s=RING * np.cos(RING * TIME))
    encoder = Run("ring", TIME, ok, angle_rad=np.sin(RING * TIME))
    angle, rate, acceleration = motion(prepare(gyro if channel == "rate" else encoder), 1000.0)
    assert amplitude(rate) / amplitude(angle) == pytest.approx(RING, rel=5e-4)
    assert amplitude(acceleration) / amplitude(angle) == pytest.approx(RING**2, rel=5e-4)
    assert amplitude(angle) == pytest.approx(1.0, rel=5e-4)


def test_where_an_encoder_reads_the_angle_too_the_motion_does_not_begin_at_zero() -> None:
    ok = np.ones(len(TIME), bool)
    angle = 0.3 + np.sin(RING * TIME)
    both = Run("ring", TIME, ok, rate_rad_s=RING * np.cos(RING * TIME), angle_rad=angle)
    for read in ({}, {"beside": angle, "beside_noise": 1e-6}):
        trace = replace(prepare(both), channel="rate", measured=both.rate_rad_s, **read)
        found, _, _ = motion(trace, 400.0)
        np.testing.assert_allclose(found[500:-500], angle[500:-500], atol=2e-3)


def test_the_low_pass_is_fourth_order_and_moves_nothing_in_time() -> None:
    for f, gain in ((2.0, 1.0), (15.0, 0.5), (60.0, (15.0 / 60.0) ** 4)):
        x = np.sin(2 * np.pi * f * TIME)
        y = low_pass(x, 15.0, 1e-3)[500:3500]
        assert y @ x[500:3500] / (x[500:3500] @ x[500:3500]) == pytest.approx(gain, rel=0.05)
        assert abs(y @ np.cos(2 * np.pi * f * TIME)[500:3500]) < 0.02 * abs(y @ x[500:3500])


def test_a_cut_off_beyond_the_samples_changes_nothing() -> None:
    x = np.random.default_rng(1).standard_normal(100)
    np.testing.assert_array_equal(low_pass(x, 500.0, 1e-3), x)


def test_at_the_true_parameters_only_what_the_gyros_noise_makes_is_left() -> None:
    traces = traces_of(campaign(bias=2e-3))
    inside = 1900  # samples from the middle: the low-pass swings at both ends of a run
    masks = [t.keep & (np.abs(np.arange(len(t.keep)) - 2000) <= inside) for t in traces]
    parts = [torque_residual(t, Structure(), JCK, 100.0) for t in traces]
    found = relative(parts, masks)
    floor = torque_noise_floor(traces, JCK, 100.0, masks)
    assert found is not None
    assert floor == pytest.approx(0.01, rel=0.9), "hundredths of a newton metre"
    assert found[0] == pytest.approx(floor, rel=0.5)


def test_a_missing_effect_stands_in_the_residual_at_its_size() -> None:
    trace = prepare(sine_run(104, 3, effects={"quadratic_damping": {"factor": 0.05}}, noise=1e-9))
    part = torque_residual(trace, Structure(), JCK, 100.0)
    assert part is not None
    _, rate, _ = motion(trace, 100.0)
    drag = low_pass(0.05 * rate * np.abs(rate), 100.0, 1e-3)
    inside = slice(300, -300)
    ramp = np.polyfit(TIME[inside], (part.residual - drag)[inside], 1)
    assert np.max(np.abs((part.residual - drag)[inside] - np.polyval(ramp, TIME[inside]))) < 0.02 * np.max(drag)


@pytest.mark.parametrize("name", ["cubic_stiffness", "backlash", "creep", "torque_delay", "unbalance"])
def test_with_the_effect_in_the_model_nothing_of_it_is_left(name: str) -> None:
    trace = prepare(sine_run(104, 3, effects={name: VALUES[name]}, noise=1e-9))
    values = dict(JCK) | {(name, p): v for p, v in VALUES[name].items()}
    without = torque_residual(trace, Structure(), JCK, 100.0)
    with_it = torque_residual(trace, Structure(effects=(name,)), values, 100.0)
    assert without is not None and with_it is not None
    inside = slice(300, -300)
    assert np.std(with_it.residual[inside]) < 0.05 * np.std(without.residual[inside])


def test_a_known_added_inertia_is_part_of_the_model() -> None:
    heavy = replace(sine_run(104, 3, jck=(0.024, *TRUTH[1:]), noise=1e-9), added_inertia_kg_m2=0.004)
    part = torque_residual(prepare(heavy), Structure(), JCK, 100.0)
    assert part is not None
    assert np.std(part.residual[300:-300]) < 2e-3, "of 104 N m"


def test_a_run_without_torque_has_no_torque_residual() -> None:
    run = replace(sine_run(104, 3), torque_nm=None, torque_time_s=None)
    assert torque_residual(prepare(run), Structure(), JCK, 100.0) is None
    assert relative([None], [np.ones(3, bool)]) is None


def test_the_low_pass_is_the_butterworth_that_its_name_says() -> None:
    x = np.random.default_rng(2).standard_normal(4001)
    sos = signal.butter(2, 15.0, fs=1000.0, output="sos")
    np.testing.assert_allclose(low_pass(x, 15.0, 1e-3)[500:-500], signal.sosfiltfilt(sos, x)[500:-500], atol=1e-3)


@pytest.mark.parametrize(("lag", "late_s"), [("sensor_lag", 5e-3), ("sensor_lag_second_order", 5e-3)])
def test_behind_a_gyros_low_pass_only_the_sensors_noise_is_left(lag: str, late_s: float) -> None:
    """At 9 Hz a delay as long as the low-pass leaves a few percent of the torque: another amplitude, and phase."""
    run = sine_run(42.0, 9.0, effects={lag: {"time": late_s}})
    trace = prepare(run)
    values = {**JCK, (lag, "time"): late_s, ("torque_delay", "delay"): late_s}
    left = {}
    for effect in (lag, "torque_delay", None):
        part = torque_residual(trace, Structure(effects=(effect,) if effect else ()), values, 40.0)
        assert part is not None
        inside = slice(500, -500)
        left[effect] = float(np.std(part.residual[inside]) / np.std(part.torque[inside]))
    floor = torque_noise_floor([trace], JCK, 40.0, [trace.keep])
    assert floor is not None
    assert left[lag] < 1.1 * floor / float(np.std(part.torque[inside]))
    assert left["torque_delay"] > 2.0 * left[lag]
    assert left[None] > 3.0 * left["torque_delay"]
