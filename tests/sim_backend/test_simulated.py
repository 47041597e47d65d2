"""The simulated rig as the sequencer sees it: what is recorded explains the motion, and hides the truth."""

from __future__ import annotations

import dataclasses
import math
import pickle
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from rig.clock import VirtualClock
from rig.config.excitation import ExcitationConfig
from rig.config.limits import LimitsConfig
from rig.config.simulated import SimulatedConfig
from rig.dynamics import TorqueSignal, simulate
from rig.errors import ConfigError, DeviceFault
from rig.excitation import Sine, planned
from rig.guard import Guard
from rig.platform import Platform
from rig.recording.run import Recording, Run
from rig.sequencer import Campaign, Sequencer
from sim_backend.simulated import SimulatedRig

EFFECTS = {"coulomb_friction": {"level_nm": 1.2}, "torque_delay": {"delay_s": 6e-4}}
LIMITS = LimitsConfig(travel_deg=30, rate_deg_s=2000, frozen_gyro_ms=None)
SHORT = Sine(torque_nm=60, frequency_hz=9, duration_s=2.0)
DRIVES: list[dict[str, Any]] = [
    {"kind": "ideal"},
    {"kind": "hold", "resolution_nm": 0.3},
    {"kind": "motor", "bandwidth_hz": 300},
    {"kind": "motor", "control": "voltage", "torque_constant_nm_a": 0.5, "gear_ratio": 10},
]


def config(amplifier: dict[str, Any] | None = None, **more: Any) -> SimulatedConfig:
    keys: dict[str, Any] = {
        "platform": {"inertia_kg_m2": 0.0203, "damping_nm_s_rad": 0.0447, "effects": EFFECTS},
        "gyro": {"noise_deg_s": 0, "full_scale_deg_s": None},
        "amplifier": amplifier or {"kind": "ideal"},
    }
    return SimulatedConfig.model_validate(keys | more)


def played(simulated: SimulatedConfig, *sets: Sine, limits: LimitsConfig = LIMITS, start_s: float = 0.0) -> Campaign:
    rig = SimulatedRig(simulated, 1000.0)
    clock = VirtualClock(start_s)
    sequencer = Sequencer(rig, clock, Guard(limits), sample_rate_hz=1000.0, rest_s=3.0)
    campaign = sequencer.play(planned(sets or (SHORT,)))
    assert campaign.cause is None, campaign.cause
    return campaign


def explained(run: Run, truth: Platform, substeps: int = 8) -> np.ndarray:
    assert run.torque_time_s is not None and run.torque_nm is not None and run.rate_rad_s is not None
    torque = TorqueSignal(run.torque_time_s, run.torque_nm, run.torque_hold)
    return run.rate_rad_s - simulate(truth, run.time_s, torque, substeps=substeps).sensed_rate_rad_s


@pytest.mark.parametrize("drive", DRIVES, ids=["ideal", "hold", "motor", "voltage-driven gear"])
def test_the_recorded_torque_and_the_truth_reproduce_the_recorded_rate(drive: dict[str, Any]) -> None:
    simulated = config(drive)
    run = played(simulated).recording.runs[0]
    assert np.abs(explained(run, simulated.platform.platform())).max() < math.radians(1e-3)


def test_an_ideal_drive_is_recorded_as_samples_of_the_continuous_sine() -> None:
    run = played(config()).recording.runs[0]
    assert run.torque_hold == "band_limited"
    assert run.torque_time_s is not None
    np.testing.assert_allclose(run.torque_nm, SHORT.torque(run.torque_time_s), atol=1e-7)


def test_a_held_drive_is_recorded_as_the_rounded_values_it_held() -> None:
    run = played(config({"kind": "hold", "resolution_nm": 0.3})).recording.runs[0]
    assert run.torque_hold == "zero_order"
    assert run.torque_nm is not None and run.torque_time_s is not None
    steps = run.torque_nm / 0.3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(run.torque_nm - SHORT.torque(run.torque_time_s))[:-1].max() <= 0.15 + 1e-6


def test_a_motor_reports_the_torque_of_its_current_and_not_the_torque_asked_for() -> None:
    run = played(config({"kind": "motor", "bandwidth_hz": 100})).recording.runs[0]
    assert run.torque_nm is not None and run.torque_time_s is not None
    asked = SHORT.torque(run.torque_time_s)
    lag_s = 1 / (2 * math.pi * 100) + 0.5e-3  # of the loop, and half of the hold between commands
    np.testing.assert_allclose(run.torque_nm[500:], SHORT.torque(run.torque_time_s - lag_s)[500:], atol=0.06 * 60)
    assert np.abs(run.torque_nm - asked).max() > 5.0


def test_the_rotor_of_a_geared_motor_adds_to_the_inertia_with_the_square_of_the_ratio() -> None:
    drive = {"kind": "motor", "torque_constant_nm_a": 0.5, "gear_ratio": 10, "rotor_inertia_kg_m2": 3e-5}
    simulated = config(drive)
    run = played(simulated).recording.runs[0]
    bare = simulated.platform.platform()
    geared = dataclasses.replace(bare, inertia_kg_m2=bare.inertia_kg_m2 + 3e-3)
    assert np.abs(explained(run, geared)).max() < math.radians(1e-3)
    assert np.abs(explained(run, bare)).max() > math.radians(10)


def test_only_the_gyros_noise_is_left_when_the_truth_is_known() -> None:
    simulated = config(gyro={"noise_deg_s": 0.05, "full_scale_deg_s": None})
    campaign = played(simulated)
    residual = np.degrees(explained(campaign.recording.runs[0], simulated.platform.platform()))
    assert residual.std() == pytest.approx(0.05, rel=0.05)
    assert campaign.recording.noise == pytest.approx(math.radians(0.05))


def test_the_same_seed_gives_the_same_samples_and_sets_have_streams_of_their_own() -> None:
    noisy = config(gyro={"full_scale_deg_s": None})
    once, again = played(noisy, SHORT, SHORT).recording.runs, played(noisy, SHORT, SHORT).recording.runs
    np.testing.assert_array_equal(once[1].rate_rad_s, again[1].rate_rad_s)
    alone = played(noisy, SHORT).recording.runs
    np.testing.assert_array_equal(once[0].rate_rad_s, alone[0].rate_rad_s)
    assert once[0].rate_rad_s is not None and once[1].rate_rad_s is not None
    assert np.abs(once[0].rate_rad_s - once[1].rate_rad_s).std() > math.radians(0.05)


def test_a_gyro_may_sample_at_a_rate_of_its_own() -> None:
    simulated = config(gyro={"noise_deg_s": 0, "sample_rate_hz": 2000, "full_scale_deg_s": None})
    run = played(simulated).recording.runs[0]
    np.testing.assert_allclose(np.diff(run.time_s), 5e-4, atol=1e-9)
    assert np.abs(explained(run, simulated.platform.platform(), substeps=4)).max() < math.radians(1e-3)


def test_rates_without_a_common_grid_are_refused_with_the_cure() -> None:
    with pytest.raises(ConfigError, match="choose rates of which one is a multiple"):
        SimulatedRig(config(gyro={"sample_rate_hz": 999.7}), 1000.0)


def test_the_zero_of_the_clock_does_not_matter() -> None:
    a = played(config()).recording.runs[0]
    b = played(config(), start_s=512.0).recording.runs[0]
    np.testing.assert_allclose(a.time_s, b.time_s, atol=1e-9)
    np.testing.assert_allclose(a.rate_rad_s, b.rate_rad_s, atol=1e-9)  # type: ignore[arg-type]


def test_torque_needs_an_armed_rig() -> None:
    rig = SimulatedRig(config(), 1000.0)
    with pytest.raises(DeviceFault, match="open it first"):
        rig.arm()
    with rig.opened(), pytest.raises(DeviceFault, match="arm it first"):
        rig.exchange(0.0, 1.0)


def test_after_torque_off_the_platform_rings_freely() -> None:
    truth = Platform(inertia_kg_m2=0.0203, damping_nm_s_rad=0.0447)
    rig = SimulatedRig(config(platform={"inertia_kg_m2": 0.0203, "damping_nm_s_rad": 0.0447}), 1000.0)
    with rig.opened(), rig.armed():
        rig.begin_set(SHORT.torque, 0.0)
        for k in range(11):
            rig.exchange(k * 1e-3, float(SHORT.torque(k * 1e-3)))
        rig.torque_off()
        after = [rig.exchange(0.011 + k * 1e-3, 0.0) for k in range(200)]
    rate = np.array([e.gyro[0].rate_rad_s for e in after])
    assert all(e.torque[-1].torque_nm == 0.0 for e in after)
    w = math.sqrt(truth.stiffness_nm_rad / truth.inertia_kg_m2)
    crossings = np.count_nonzero(np.diff(np.sign(rate)))
    assert crossings == pytest.approx(0.2 * w / math.pi, abs=1)


def test_the_opening_line_says_that_torque_is_simulated() -> None:
    assert str(SimulatedRig(config(), 1000.0).statement()).startswith("Torque is SIMULATED")


def _leaves(value: Any) -> list[Any]:
    if isinstance(value, (str, int, float, bool, np.ndarray)) or value is None:
        return [value]
    if isinstance(value, (Recording, Run)):
        return [x for f in dataclasses.fields(value) for x in _leaves(getattr(value, f.name))]
    if isinstance(value, Mapping):
        return [x for pair in value.items() for x in _leaves(pair)]
    if isinstance(value, tuple):
        return [x for item in value for x in _leaves(item)]
    raise AssertionError(f"a recording holds a {type(value)}: only samples and plain text belong in it")


def test_a_recording_is_made_of_samples_and_plain_text_and_names_nothing_of_the_truth() -> None:
    simulated = config()
    recording = played(simulated).recording
    hidden = [0.0203, 0.0447, 677.3, 1.2, 6e-4]
    for leaf in _leaves(recording):
        if isinstance(leaf, float):
            assert leaf not in hidden
        if isinstance(leaf, str):
            assert not any(word in leaf for word in ("friction", "delay", "inertia", "0.0203"))
    assert b"sim_backend" not in pickle.dumps(recording)


def test_a_run_has_no_place_where_truth_could_hide() -> None:
    assert {f.name for f in dataclasses.fields(Run)} == {
        "name", "time_s", "valid", "rate_rad_s", "angle_rad", "torque_time_s", "torque_nm", "torque_hold",
        "use", "min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "channels", "causes",
            "rate_corner_hz", "rate_delay_s",  # of the gyro's data sheet
            "excerpt",  # of a long recording
            "wraps",  # of an angle within one turn
            "notes",  # of its reading: rows left out, numbers that stood for none
            "missing",  # of rows without a value
    }  # fmt: skip
    assert not played(config()).recording.runs[0].channels


def test_the_default_campaign_plays_in_a_few_seconds() -> None:
    rig = SimulatedRig(SimulatedConfig(), 1000.0)
    sets = tuple(s.scaled(0.25) for s in planned(ExcitationConfig().sets))
    sequencer = Sequencer(rig, VirtualClock(), Guard(LimitsConfig()), sample_rate_hz=1000.0, rest_s=12.0)
    sequencer.play(sets[:1])  # compiled code is loaded before the time is taken
    begin = time.process_time()
    campaign = sequencer.play(sets)
    assert campaign.cause is None
    assert time.process_time() - begin < 6.0  # about one second alone on two cores
