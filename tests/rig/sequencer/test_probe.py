"""The probe: sign, scale and stiction from a few small pulses, whatever the spring and the friction are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from rig.config.bench import ProbeConfig
from rig.config.limits import LimitsConfig
from rig.config.root import Config
from rig.errors import SafetyTrip
from rig.excitation import Sine
from rig.excitation.planned import PlannedSet, planned
from rig.guard.base import Rest, Tick
from rig.platform import Platform
from rig.sequencer.probe import Probe
from sim_backend.simulated import SimulatedRig

DECLARED = Platform(0.0185, 0.06, 650.0)
LIMITS = LimitsConfig(torque_nm=150)
SETS = planned([Sine(torque_nm=90.0, frequency_hz=0.5)])
NOISE = 8.7e-4


USUAL = ProbeConfig()


def probed(
    truth: Mapping[str, object], declared: Platform = DECLARED, sign: float = 1.0, config: ProbeConfig = USUAL,
    rate_hz: float = 2000.0, sets: Sequence[PlannedSet] = SETS,
) -> tuple[str, float, float]:  # fmt: skip
    """(finding, seconds it took, largest torque) on the simulated platform."""
    simulated = {"platform": truth, "gyro": {"full_scale_deg_s": None, "sample_rate_hz": rate_hz}}
    whole = Config.model_validate({"name": "x", "backend": "simulated", "simulated": simulated})
    rig = SimulatedRig(whole.simulated, 1000.0)
    probe = Probe(config, LIMITS, declared, sets)
    probe.begin(Rest(noise_rad_s=NOISE))
    peak, k = 0.0, 0
    with rig.opened(), rig.armed():
        while not probe.over:
            at_s = 1e-3 * k
            torque = probe.torque(at_s)
            peak = max(peak, abs(torque))
            reply = rig.exchange(at_s, torque)
            gyro = [sample._replace(rate_rad_s=sign * sample.rate_rad_s) for sample in reply.gyro]
            probe.take(at_s, 0.0, Tick(at_s, 0.0, 1e-3, torque, gyro, reply.torque, {}))
            k += 1
    return probe.finding(), 1e-3 * k, peak


def inertia_in(finding: str) -> float:
    return float(finding.split("inertia of ", 1)[1].split(" ", 1)[0])


def platform(inertia: float = 0.0203, stiffness: float = 681.2, **effects: Mapping[str, float]) -> dict[str, object]:
    return {
        "inertia_kg_m2": inertia, "damping_nm_s_rad": 0.0447, "stiffness_nm_rad": stiffness, "effects": effects,
    }  # fmt: skip


@pytest.mark.parametrize(
    "truth",
    [
        platform(),
        platform(0.0100), platform(0.0350), platform(stiffness=325.0), platform(stiffness=1300.0),
        platform(coulomb_friction={"level_nm": 1.0}),
        platform(coulomb_friction={"level_nm": 8.0}),
        platform(stribeck_friction={"coulomb_nm": 3.0, "static_nm": 6.0, "speed_rad_s": 0.2}),
        platform(torque_delay={"delay_s": 0.004}),
        platform(actuator_lag={"time_s": 0.003}),
        platform(backlash={"half_gap_rad": 0.003}),
        platform(presliding_friction={"level_nm": 3.0, "displacement_rad": 0.001}),
    ],
    ids=str,
)  # fmt: skip
def test_the_inertia_is_found_whatever_else_acts(truth: dict[str, object]) -> None:
    finding, took_s, _ = probed(truth)
    assert inertia_in(finding) == pytest.approx(truth["inertia_kg_m2"], rel=0.3)
    assert took_s < 1.0


def test_a_platform_without_a_spring_is_probed_too() -> None:
    finding, _, _ = probed(platform(0.5, 0.0), Platform(0.6, 0.5, 0.0, terms=("inertia", "damping")))
    assert inertia_in(finding) == pytest.approx(0.5, rel=0.1)


def test_the_pulses_are_small() -> None:
    _, _, peak_nm = probed(platform())
    assert peak_nm < 5.0


def test_a_wrong_sign_is_refused_with_its_cure() -> None:
    with pytest.raises(SafetyTrip, match=r"opposite signs.*bench\.gyroscope\.invert"):
        probed(platform(), sign=-1.0)


@pytest.mark.parametrize("factor", [0.4, 2.6])
def test_a_scale_beyond_a_factor_of_two_is_refused(factor: float) -> None:
    with pytest.raises(SafetyTrip, match=r"declared 0\.0185, allowed 0\.00925 to 0\.037"):
        probed(platform(), sign=1.0 / factor)


def through_a_bench(
    share: float, friction_nm: float, left_by_nm: float = 0.0, sign: float = 1.0, delay_s: float = 0.001
) -> str:
    """What is found with torque in steps and late, behind the gyro's low-pass; pushed off centre before, if asked."""
    delay = {"delay_s": delay_s}
    truth = platform(share * DECLARED.inertia_kg_m2, torque_delay=delay)
    if friction_nm:
        friction = {"level_nm": friction_nm}
        truth = platform(share * DECLARED.inertia_kg_m2, torque_delay=delay, coulomb_friction=friction)
    simulated = {
        "platform": truth,
        "gyro": {"sample_rate_hz": 2000, "bandwidth_hz": 262},
        "amplifier": {"kind": "hold", "resolution_nm": 0.12},
    }
    whole = Config.model_validate({"name": "x", "backend": "simulated", "simulated": simulated})
    rig = SimulatedRig(whole.simulated, 1000.0)
    probe = Probe(USUAL, LIMITS, DECLARED, planned([Sine(torque_nm=60.0, frequency_hz=3.0)]))
    probe.begin(Rest(noise_rad_s=NOISE))
    with rig.opened(), rig.armed():
        pushed = [left_by_nm * min(k, 500 - k, 200) / 200 for k in range(500)] + [0.0] * 100
        for k, torque in enumerate(pushed if left_by_nm else []):
            rig.exchange(1e-3 * k - 0.6, torque)
        k = 0
        while not probe.over:
            torque = probe.torque(1e-3 * k)
            reply = rig.exchange(1e-3 * k, torque)
            gyro = [sample._replace(rate_rad_s=sign * sample.rate_rad_s) for sample in reply.gyro]
            probe.take(1e-3 * k, 0.0, Tick(1e-3 * k, 0.0, 1e-3, torque, gyro, reply.torque, {}))
            k += 1
    return probe.finding()


@pytest.mark.parametrize("friction_nm", [0.0, 1.0, 8.0, 11.0, 15.0])
@pytest.mark.parametrize("share", [0.4, 3.0])
def test_friction_does_not_hide_a_scale_that_is_wrong(share: float, friction_nm: float) -> None:
    with pytest.raises(SafetyTrip, match=r"declared 0\.0185, allowed"):
        through_a_bench(share, friction_nm)


def test_a_scale_just_beyond_a_factor_of_two_is_refused_with_little_friction() -> None:
    with pytest.raises(SafetyTrip, match=r"found an inertia of"):
        through_a_bench(0.45, 1.0)


@pytest.mark.parametrize("share", [0.6, 1.8])
def test_a_second_pulse_that_meets_the_ring_of_the_first_still_finds_the_sign(share: float) -> None:
    finding = through_a_bench(share, 0.0, delay_s=0.003)
    assert inertia_in(finding) == pytest.approx(share * DECLARED.inertia_kg_m2, rel=0.3)


@pytest.mark.parametrize("friction_nm", [8.0, 11.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_platform_that_friction_left_off_centre_is_probed_from_there(friction_nm: float, way: float) -> None:
    left_by_nm = way * (12.0 + friction_nm)
    assert "are correct" in through_a_bench(1.1, friction_nm, left_by_nm)
    with pytest.raises(SafetyTrip, match=r"declared 0\.0185, allowed"):
        through_a_bench(0.4, friction_nm, left_by_nm)


@pytest.mark.parametrize("friction_nm", [0.0, 1.0, 8.0, 11.0, 15.0])
@pytest.mark.parametrize("delay_s", [0.001, 0.003])
def test_friction_does_not_make_a_right_scale_look_wrong(friction_nm: float, delay_s: float) -> None:
    finding = through_a_bench(1.1, friction_nm, delay_s=delay_s)
    assert inertia_in(finding) == pytest.approx(1.1 * DECLARED.inertia_kg_m2, rel=0.3)


@pytest.mark.parametrize("friction_nm", [0.0, 1.0, 8.0, 15.0])
def test_a_wrong_sign_is_told_from_the_right_one_under_friction(friction_nm: float) -> None:
    with pytest.raises(SafetyTrip, match="opposite signs"):
        through_a_bench(1.1, friction_nm, sign=-1.0)


def test_the_factor_can_be_widened() -> None:
    finding, _, _ = probed(platform(), sign=1.0 / 2.6, config=ProbeConfig(inertia_factor=4))
    assert "are correct" in finding


def test_a_platform_that_is_held_is_refused_and_how_hard_it_was_pushed_is_said() -> None:
    with pytest.raises(SafetyTrip, match=r"27 N m for 17 ms gave .* deg/s at most.*brake"):
        probed(platform(coulomb_friction={"level_nm": 60.0}))


def test_harder_pulses_are_played_only_as_far_as_the_file_allows() -> None:
    with pytest.raises(SafetyTrip, match=r"3 N m for 17 ms"):
        probed(platform(coulomb_friction={"level_nm": 60.0}), config=ProbeConfig(torque_nm=3.0))


@pytest.mark.parametrize("friction_nm", [0.3, 1.0, 2.0])
def test_a_campaign_of_little_torque_is_probed_too(friction_nm: float) -> None:
    little = planned([Sine(torque_nm=10.0, frequency_hz=3.0)])
    finding, _, peak_nm = probed(platform(coulomb_friction={"level_nm": friction_nm}), sets=little)
    assert inertia_in(finding) == pytest.approx(0.0203, rel=0.3)
    assert peak_nm <= 7.0


def test_a_slow_gyro_is_enough() -> None:
    finding, _, _ = probed(platform(), rate_hz=500.0)
    assert inertia_in(finding) == pytest.approx(0.0203, rel=0.3)


def test_a_gyro_that_sees_noise_only_is_refused() -> None:
    probe = Probe(ProbeConfig(), LIMITS, DECLARED, SETS)
    probe.begin(Rest(noise_rad_s=NOISE))
    noise = np.random.default_rng(1).standard_normal(20_000)
    k = 0
    while not probe.over:
        sample = Tick(1e-3 * k, 0.0, 1e-3, 0.0, ((1e-3 * k, NOISE * float(noise[k]), True),), (), {})  # type: ignore[arg-type]
        probe.take(1e-3 * k, 0.0, sample)
        k += 1
    with pytest.raises(SafetyTrip, match="no clear answer"):
        probe.finding()
