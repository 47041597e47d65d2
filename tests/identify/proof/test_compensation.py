"""The compensating torque, on a platform that is as its model says: what it leaves of the error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from identify.proof.compensation import cancelled, compensated, linear_part, not_cancelled
from identify.proof.deviation import deviation, simulated_run
from identify.proof.drive import Drive, latency_of
from identify.proof.plan import ALL, PLAIN, announced, plan_proof
from identify.proof.rounding import feedback, rounded
from rig import effects
from rig.errors import PreflightRefusal
from rig.excitation import CompensatedSet, PlannedSet, Sine
from rig.platform import Platform
from rig.preflight import Peaks, peaks
from rig.recording.run import Recording, Run
from rig.signals import TorqueHold

LINEAR = Platform(0.0203, 0.0447, 681.2)
SET = PlannedSet("3 Hz", Sine(torque_nm=60.0, frequency_hz=3.0, duration_s=3.0))
DRIVE = Drive(1e-3, "zero_order")
HOLDS: tuple[TorqueHold, ...] = ("zero_order", "band_limited")
SMOOTH = {
    "quadratic_damping": {"factor": 0.01},
    "directional_damping": {"step": 0.02},
    "cubic_stiffness": {"factor": 1000.0},
    "quadratic_stiffness": {"factor": 150.0},
    "bilinear_stiffness": {"step": 20.0},
    "hysteresis": {"level": 1.0, "yield_angle": 0.02, "exponent": 1.5, "share": 0.5},
    "creep": {"stiffness": 20.0, "time": 0.3},
    "unbalance": {"sine": 10.0, "cosine": 2.0},
    "cogging": {"sine": 0.5, "cosine": 0.3, "order": 40.0},
    "flexible_mode": {"inertia": 0.001, "frequency": 60.0, "ratio": 0.02},
    "torque_scale": {"scale": 1.03},
}
ROUGH = {  # what is left of these depends on how fine the ticks are
    "coulomb_friction": {"level": 1.0},
    "presliding_friction": {"level": 1.0, "displacement": 2e-3},
    "load_dependent_friction": {"factor": 0.03},
    "backlash": {"half_gap": 1e-3},
    "torque_delay": {"delay": 0.0013},
    "actuator_lag": {"time": 0.002},
    "torque_deadzone": {"width": 1.0},
}
WITHOUT = {
    "periodic_disturbance": {"sine": 1.0, "cosine": 0.5, "frequency": 11.0},
    "stiffness_drift": {"slope": 2.0},
    "torque_saturation": {"limit": 50.0},
    "sensor_lag": {"time": 0.001},
}


def with_effects(**given: dict[str, float]) -> Platform:
    return replace(LINEAR, effects=given)


def left_of(platform: Platform, hold: TorqueHold, resolution_nm: float | None = None) -> float:
    drive = Drive(1e-3, hold, resolution_nm)
    return announced(platform, SET, compensated(platform, SET, "c", drive), drive, angle=False).left


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("name", SMOOTH)
def test_a_smooth_effect_goes_away(name: str, hold: TorqueHold) -> None:
    assert left_of(with_effects(**{name: SMOOTH[name]}), hold) < 0.01


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("name", ROUGH)
def test_an_effect_with_corners_or_a_delay_leaves_less_than_a_tenth(name: str, hold: TorqueHold) -> None:
    assert left_of(with_effects(**{name: ROUGH[name]}), hold) < 0.10


@pytest.mark.parametrize("name", WITHOUT)
def test_what_no_torque_cancels_is_said_and_left_alone(name: str) -> None:
    platform = with_effects(**{name: WITHOUT[name]})
    assert cancelled(platform) == () and not_cancelled(platform)[name]
    made = compensated(platform, SET, "c", Drive(1e-3, "zero_order"))
    at = np.arange(0.0, 3.0, 1e-3)
    np.testing.assert_allclose(made.torque(at), SET.torque(at), atol=1e-9)


def test_every_effect_is_cancelled_or_says_why_not() -> None:
    for name in effects.names():
        effect = effects.get(name)
        assert effect.cancelled_by_torque or effect.stays, f"{name}: say in `stays` why no torque takes it away"


def test_effects_of_one_platform_are_cancelled_together() -> None:
    both = with_effects(
        coulomb_friction={"level": 1.0}, cubic_stiffness={"factor": 1000.0}, torque_delay={"delay": 1e-3}
    )
    assert left_of(both, "zero_order") < 0.07  # of which 0.05 by where in the band of the friction it rests


def test_an_effect_that_is_left_out_stays_as_it_was() -> None:
    both = with_effects(cubic_stiffness={"factor": 1000.0}, quadratic_damping={"factor": 0.02})
    drive = Drive(1e-3, "zero_order")
    alone = replace(both, effects={"quadratic_damping": both.effects["quadratic_damping"]})
    at = np.arange(0.0, 3.0, 1e-3)
    left_out = compensated(both, SET, "c", drive, ("cubic_stiffness",)).torque(at)
    np.testing.assert_allclose(left_out, compensated(alone, SET, "c", drive).torque(at), atol=1e-12)


def test_a_delay_is_asked_for_before_the_set_begins() -> None:
    made = compensated(with_effects(torque_delay={"delay": 0.0025}), SET, "c", Drive(1e-3, "zero_order"))
    assert isinstance(made.excitation, CompensatedSet)
    lead_s = made.excitation.lead_s
    assert lead_s == pytest.approx(0.004) and made.duration_s == pytest.approx(SET.duration_s + lead_s)
    assert made.torque(0.5) == pytest.approx(SET.torque(0.5 - lead_s + 0.0025), abs=0.01)


def test_commands_of_a_drive_that_rounds_are_its_steps_and_do_not_excite_the_platform() -> None:
    time_s = np.arange(10_000) * 1e-3
    wanted, step_nm = 5.0 * np.sin(2.0 * math.pi * 3.0 * time_s), 0.12
    natural = math.sqrt(LINEAR.stiffness_nm_rad / LINEAR.inertia_kg_m2)
    shaped = rounded(wanted, step_nm, feedback(LINEAR, 1e-3, 10.0))
    np.testing.assert_allclose(shaped / step_nm, np.rint(shaped / step_nm), atol=1e-9)
    turn = np.exp(-1j * natural * time_s)
    plain_rounding = step_nm * np.rint(wanted / step_nm) - wanted
    assert abs(np.sum((shaped - wanted) * turn)) < 0.1 * abs(np.sum(plain_rounding * turn))


@pytest.mark.parametrize(
    ("hold", "resolution_nm"), [("zero_order", None), ("zero_order", 0.12), ("band_limited", None)]
)
def test_the_torque_of_one_tick_is_that_of_many(hold: TorqueHold, resolution_nm: float | None) -> None:
    made = compensated(with_effects(cogging=SMOOTH["cogging"]), SET, "c", Drive(1e-3, hold, resolution_nm))
    time_s = np.concatenate([1e-3 * np.arange(-3, 3010), np.linspace(-0.01, made.duration_s + 0.01, 777)])
    np.testing.assert_array_equal([made.torque(one) for one in time_s.tolist()], made.torque(time_s))


def test_the_steps_of_a_set_are_no_error_of_a_drive_that_lags() -> None:
    assert left_of(with_effects(actuator_lag={"time": 0.001}), "zero_order") < 0.01


def test_a_drive_that_rounds_leaves_no_more_of_a_smooth_effect() -> None:
    assert left_of(with_effects(cubic_stiffness={"factor": 1000.0}), "zero_order", 0.12) < 0.02


def test_rounding_does_not_excite_the_resonances_that_an_effect_makes() -> None:
    heavy = with_effects(flexible_mode={"inertia": 0.02, "frequency": 60.0, "ratio": 0.02})  # as heavy as the platform
    assert left_of(heavy, "zero_order", 0.12) < 1.5 * left_of(heavy, "zero_order")


def test_where_a_gap_lets_the_platform_rest_is_in_what_is_announced() -> None:
    gap = with_effects(backlash={"half_gap": 1e-3})
    wanted = compensated(gap, SET, "c", DRIVE)
    seen = []
    for aside_rad in (-0.8e-3, -0.4e-3, 0.0, 0.4e-3, 0.8e-3):  # middles of five equal parts of the gap
        one, other = (deviation(simulated_run(s, gap, DRIVE, False, aside_rad), s, gap, 1e-9) for s in (SET, wanted))
        seen.append((one.rms**2, other.rms**2))
    before, after = np.mean(seen, axis=0)
    left = announced(gap, SET, wanted, DRIVE, angle=False).left
    assert left > 0.02 and left == pytest.approx(math.sqrt(after / before), rel=0.25)


@pytest.mark.parametrize("name", ["coulomb_friction", "cubic_stiffness", "torque_delay"])
def test_a_torque_that_comes_late_is_asked_for_earlier(name: str) -> None:
    platform, drive = with_effects(**{name: {**SMOOTH, **ROUGH}[name]}), Drive(1e-3, "zero_order", None, 0.0017)
    assert announced(platform, SET, compensated(platform, SET, "c", drive), drive, angle=False).left < 0.10
    on_time = compensated(platform, SET, "c", Drive(1e-3, "zero_order"))
    assert announced(platform, SET, on_time, drive, angle=False).left > 0.10


def test_how_late_a_torque_comes_shows_in_the_recording() -> None:
    time_s = np.arange(0.0, 3.0, 1e-3)
    for late_s in (0.0, 0.0017, 0.004):
        commands = np.asarray(SET.torque(time_s), dtype=float)
        run = Run(
            SET.name, time_s, np.ones(len(time_s), dtype=bool), rate_rad_s=commands, torque_time_s=time_s + late_s,
            torque_nm=0.12 * np.rint(commands / 0.12), torque_hold="zero_order",
        )  # fmt: skip
        assert latency_of(Recording((run,)), [SET], 1e-3) == pytest.approx(late_s, abs=2e-5)
    other = PlannedSet("3 Hz", Sine(torque_nm=60.0, frequency_hz=11.0, duration_s=3.0))
    assert latency_of(Recording((run,)), [other], 1e-3) == 0.0


def test_the_sets_alternate_and_stay_within_the_limits() -> None:
    model = with_effects(cubic_stiffness={"factor": -4000.0}, coulomb_friction={"level": 1.0})
    several = [replace(SET, name=n, scale=s) for n, s in (("a", 0.5), ("b", 1.0))]
    allowed = Peaks(8.0, 300.0, 60.5)
    plan = plan_proof(model, several, allowed, Drive(1e-3, "zero_order"))
    assert [r.variant for r in plan.runs[:4]] == [PLAIN, ALL, "cubic_stiffness", "coulomb_friction"]
    assert [r.variant for r in plan.runs[4:]] == [r.variant for r in reversed(plan.runs[:4])]
    assert 0.0 < plan.torque_scale["b"] < 1.0 and "a" not in plan.torque_scale
    for run in plan.runs:
        assert peaks(model, run.planned).within(allowed), run.planned.name


def test_a_set_that_no_torque_brings_within_the_limits_is_refused_in_words() -> None:
    model = with_effects(coulomb_friction={"level": 20.0})
    with pytest.raises(
        PreflightRefusal, match="3 Hz: with compensation, even 2 % of this set's torque exceeds the limits"
    ):
        plan_proof(model, [SET], Peaks(10.0, 400.0, 10.0), Drive(1e-3, "zero_order"))


def test_the_linear_part_keeps_the_sensor() -> None:
    assert set(linear_part(with_effects(sensor_lag={"time": 1e-3}, cubic_stiffness={"factor": 1.0})).effects) == {
        "sensor_lag"
    }


@pytest.mark.parametrize("name", ["actuator_lag", "torque_deadzone", "torque_scale"])
def test_rounding_passes_through_the_drive_before_the_linear_model_is_given_it(name: str) -> None:
    platform, drive = with_effects(**{name: (ROUGH | SMOOTH)[name]}), Drive(1e-3, "zero_order", 0.12)
    wanted = compensated(platform, SET, "c", drive)
    left = deviation(simulated_run(wanted, platform, drive, False), wanted, platform, 1e-9)
    assert left.rms < 0.2 * math.radians(0.05)  # of the noise of a gyro; 1.6 times of it without


def test_a_set_without_compensation_is_foretold_in_the_steps_of_the_drive() -> None:
    run = simulated_run(SET, LINEAR, Drive(1e-3, "zero_order", 0.12), angle=False)
    assert run.torque_nm is not None
    steps = run.torque_nm / 0.12
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_a_rival_whose_model_runs_away_is_refused_in_words() -> None:
    model = with_effects(cubic_stiffness={"factor": 1000.0})
    cogging = {"cogging": {"sine": 4424.0, "cosine": 82.5, "order": 0.5}}
    rival = Platform(1e-4, -0.14, 0.0, effects=cogging)
    with pytest.raises(PreflightRefusal, match=r"with cogging .* grows without bound.*Leave out --rival"):
        plan_proof(
            model, [SET], Peaks(10.0, 400.0, 150.0), Drive(1e-3, "zero_order", 0.12),
            rivals={"cubic_stiffness / cogging": rival},
        )  # fmt: skip
