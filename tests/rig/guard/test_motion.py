"""The motion is held against the torque: what no platform does trips, what any platform may do does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rig.clock import VirtualClock
from rig.config.limits import LimitsConfig
from rig.config.load import load_config
from rig.config.root import Config
from rig.errors import RigError, SafetyTrip
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.interface import Exchange, GyroSample
from rig.platform import Platform
from rig.preflight import plan
from rig.sequencer import Sequencer
from sim_backend.simulated import SimulatedRig

DECLARED = Platform(0.0185, 0.06, 650.0)
WIDE = {"travel_deg": 40, "rate_deg_s": 2000, "torque_nm": 150}
SETS = (
    {"torque_nm": 60, "frequency_hz": 0.5, "duration_s": 2},
    {"torque_nm": 50, "frequency_hz": 6, "duration_s": 1},
    {"torque_nm": 20, "frequency_hz": 14, "duration_s": 1},
    {"torque_nm": 8, "frequency_hz": 29, "duration_s": 1},
    {"kind": "multisine", "torque_nm": 40, "from_hz": 0.5, "to_hz": 40, "duration_s": 2},
    {"kind": "chirp", "torque_nm": 10, "from_hz": 0.5, "to_hz": 40, "soft_start_s": 0.2, "duration_s": 2},
    {"kind": "ramp_hold_release", "torque_nm": 60, "ramp_s": 0.5, "hold_s": 0.3, "release_s": 0.2, "duration_s": 1.5},
    {"kind": "free_decay", "torque_nm": 60, "pull_s": 0.5, "hold_s": 0.3, "duration_s": 1.5},
)
Bend = Callable[[float, float], float]  # (time_s, rate_rad_s) -> what the gyro says


class BentRig(SimulatedRig):
    """The simulated rig with a gyro that lies."""

    def __init__(self, config: Config, bend: Bend) -> None:
        super().__init__(config.simulated, config.excitation.sample_rate_hz)
        self._bend = bend

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        reply = super().exchange(now_s, torque_nm)
        gyro = [GyroSample(t, self._bend(t, rate), valid) for t, rate, valid in reply.gyro]
        return Exchange(gyro, reply.torque, reply.channels)


def straight(time_s: float, rate_rad_s: float) -> float:
    return rate_rad_s


def campaign(
    truth: Mapping[str, object],
    sets: Sequence[Mapping[str, object]] = SETS,
    rest_s: float = 4.0,
    limits: Mapping[str, float] = WIDE,
) -> Config:
    simulated = {"platform": truth, "gyro": {"full_scale_deg_s": None, "sample_rate_hz": 2000}}
    excitation = {"sets": sets, "rest_s": rest_s, "scale_to_limits": True, "margin": 0.6}
    given = {"name": "x", "backend": "simulated", "limits": limits, "excitation": excitation, "simulated": simulated}
    return Config.model_validate(given)


def played(config: Config, declared: Platform = DECLARED, bend: Bend = straight) -> RigError | None:
    rig = BentRig(config, bend)
    sets = plan(declared, config.excitation, LimitsConfig(torque_nm=150))  # far within the guard's own limits
    guard = Guard(config.limits, motion_checks(config.limits, declared))
    rest_s = config.excitation.rest_s
    return Sequencer(rig, VirtualClock(), guard, sample_rate_hz=1000, rest_s=rest_s).play(sets).cause


HIDDEN: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "coulomb_friction": {"level_nm": (0.2, 6.0)},
    "stribeck_friction": {"coulomb_nm": (0.2, 3.0), "static_nm": (3.0, 5.0), "speed_rad_s": (0.05, 0.5)},
    "presliding_friction": {"level_nm": (0.2, 4.0), "displacement_rad": (1e-4, 3e-3)},
    "quadratic_damping": {"factor_nm_s2_rad2": (0.001, 0.05)},
    "cubic_stiffness": {"factor_nm_rad3": (500.0, 20_000.0)},
    "backlash": {"half_gap_rad": (0.0005, 0.01)},
    "hysteresis": {"level_nm": (0.5, 5.0), "yield_angle_rad": (0.002, 0.02), "exponent": (1, 2), "share": (0.4, 0.6)},
    "creep": {"stiffness_nm_rad": (20.0, 200.0), "time_s": (0.1, 2.0)},
    "unbalance": {"sine_nm": (-5.0, 5.0), "cosine_nm": (-5.0, 5.0)},
    "cogging": {"sine_nm": (-1.0, 1.0), "cosine_nm": (-1.0, 1.0), "order": (6.0, 40.0)},
    "torque_delay": {"delay_s": (0.0002, 0.004)},
    "actuator_lag": {"time_s": (0.0002, 0.004)},
    "torque_saturation": {"limit_nm": (20.0, 50.0)},
    "torque_deadzone": {"width_nm": (0.2, 4.0)},
    "torque_offset": {"level_nm": (-3.0, 3.0)},
    "flexible_mode": {"inertia_kg_m2": (0.002, 0.01), "frequency_hz": (8.0, 90.0), "ratio": (0.01, 0.05)},
    "periodic_disturbance": {"sine_nm": (-1.0, 1.0), "cosine_nm": (-1.0, 1.0), "frequency_hz": (5.0, 60.0)},
    "sensor_lag": {"time_s": (0.0002, 0.002)},
}


def hidden_platform(rng: np.random.Generator) -> dict[str, object]:
    """Inertia and stiffness up to a factor of two from the declared ones, and two effects nobody declared."""
    names = rng.choice(list(HIDDEN), size=2, replace=False)
    effects = {str(name): {key: float(rng.uniform(*span)) for key, span in HIDDEN[str(name)].items()} for name in names}
    return {
        "inertia_kg_m2": DECLARED.inertia_kg_m2 * float(2.0 ** rng.uniform(-1, 1)),
        "damping_nm_s_rad": float(10.0 ** rng.uniform(-1.7, 0)),
        "stiffness_nm_rad": DECLARED.stiffness_nm_rad * float(2.0 ** rng.uniform(-1, 1)),
        "effects": effects,
    }


# One draw of many: the others are slow.
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 40))])
def test_no_platform_within_a_factor_of_two_trips_whatever_it_hides(seed: int) -> None:
    truth = hidden_platform(np.random.default_rng([402, seed]))
    assert played(campaign(truth)) is None, truth


SINES = SETS[:2]
USUAL = {"inertia_kg_m2": 0.0203, "damping_nm_s_rad": 0.0447, "stiffness_nm_rad": 681.2}
RUBBING = USUAL | {"effects": {"coulomb_friction": {"level_nm": 1.0}}}


def tripped(truth: Mapping[str, object], bend: Bend, sets: Sequence[Mapping[str, object]] = SINES[:1]) -> str:
    cause = played(campaign(truth, sets, limits={"torque_nm": 150}), bend=bend)
    assert isinstance(cause, SafetyTrip), cause
    return str(cause)


def when(text: str) -> float:
    return float(text.split(" s, allowed", maxsplit=1)[0].rsplit(" ", 1)[1])


@pytest.mark.parametrize("truth", [USUAL, RUBBING])
@pytest.mark.parametrize("hz", [0.5, 6.0, 12.0])
def test_a_gyro_the_wrong_way_round_trips_within_half_a_cycle(truth: Mapping[str, object], hz: float) -> None:
    text = tripped(truth, lambda t, rate: -rate, [{"torque_nm": 60, "frequency_hz": hz, "duration_s": 2}])
    assert "opposite signs" in text
    assert "bench.gyroscope.invert" in text
    assert when(text) < 0.5 / hz


@pytest.mark.parametrize("declared", [Platform(0.01, 0.06, 1300.0), Platform(0.04, 0.06, 340.0)])
def test_a_wrong_sign_is_seen_with_a_declared_model_that_is_wrong_by_two(declared: Platform) -> None:
    cause = played(campaign(USUAL, SINES[:1]), declared, lambda t, rate: -rate)
    assert "opposite signs" in str(cause)


@pytest.mark.parametrize("moment_s", [1.0, 1.33, 1.5])
def test_a_sign_that_turns_while_the_platform_is_fast_is_seen(moment_s: float) -> None:
    fast = [{"torque_nm": 60, "frequency_hz": 6, "duration_s": 3}]
    text = tripped(USUAL, lambda t, rate: -rate if t > moment_s else rate, fast)
    assert any(word in text for word in ("opposite signs", "jump", "travel"))
    assert when(text) < moment_s - 0.5 + 1.0  # times of trips count from the start of the set, after the settling


@pytest.mark.parametrize("moment_s", [0.8, 1.0, 1.45])
def test_a_gyro_that_came_off_its_shaft_is_seen(moment_s: float) -> None:
    rng = np.random.default_rng(1)
    text = tripped(RUBBING, lambda t, rate: 1e-3 * float(rng.standard_normal()) if t > moment_s else rate)
    assert "jump" in text or "nothing moved" in text
    assert when(text) < moment_s - 0.5 + 0.8


@pytest.mark.parametrize("step", [2.5, -4.0])
def test_a_rate_that_steps_is_seen_at_once(step: float) -> None:
    text = tripped(USUAL, lambda t, rate: rate + step if t > 1.2 else rate)
    assert "implausible jump" in text
    assert when(text) == pytest.approx(0.7, abs=0.003)


def test_a_single_sample_beside_the_others_is_seen() -> None:
    text = tripped(USUAL, lambda t, rate: rate + (4.0 if 1.2 < t < 1.2007 else 0.0))
    assert "implausible jump" in text


def test_a_brake_that_is_on_is_seen_before_the_torque_is_full() -> None:
    stuck = USUAL | {"effects": {"coulomb_friction": {"level_nm": 140.0}}}
    text = tripped(stuck, straight)
    assert "nothing moved" in text
    assert "brake" in text


def test_what_may_stand_still_can_be_set_and_all_of_it_be_switched_off() -> None:
    stuck = campaign(USUAL | {"effects": {"coulomb_friction": {"level_nm": 140.0}}}, SINES[:1])
    patient = stuck.model_copy(update={"limits": stuck.limits.model_copy(update={"standstill_torque_nm": 300.0})})
    assert played(patient) is None
    assert motion_checks(LimitsConfig(motion_check=False), DECLARED) == ()


@pytest.mark.slow
@pytest.mark.parametrize("file", ["rig.yaml", "examples/table1.yaml", "examples/table2.yaml", "examples/bench.yaml"])
@pytest.mark.parametrize("wrong", [(1.0, 1.0), (2.0, 0.5), (0.5, 2.0)])
def test_campaigns_as_shipped_do_not_trip(
    file: str, wrong: tuple[float, float], request: pytest.FixtureRequest
) -> None:
    config = load_config(request.config.rootpath / file).config
    declared = config.model.platform()
    rig = SimulatedRig(config.simulated, config.excitation.sample_rate_hz)
    sets = plan(declared, config.excitation, config.limits, rig.rate_full_scale_rad_s)
    believed = replace(
        declared,
        inertia_kg_m2=declared.inertia_kg_m2 * wrong[0], stiffness_nm_rad=declared.stiffness_nm_rad * wrong[1],
    )  # fmt: skip
    guard = Guard(config.limits, motion_checks(config.limits, believed))
    sequencer = Sequencer(rig, VirtualClock(), guard, sample_rate_hz=1000, rest_s=config.excitation.rest_s)
    assert sequencer.play(sets).cause is None
