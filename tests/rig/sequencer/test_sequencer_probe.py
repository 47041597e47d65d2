"""Before the first set: the probe, a rest until the platform is still, and the way out where it found something."""

from __future__ import annotations

import math

import pytest

from rig.clock import VirtualClock
from rig.config.bench import ProbeConfig
from rig.config.limits import LimitsConfig
from rig.config.root import Config
from rig.errors import SafetyTrip
from rig.excitation import Sine
from rig.excitation.planned import planned
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.interface import Exchange, GyroSample, TorqueSample
from rig.platform import Platform
from rig.sequencer import Campaign, Observer, Sequencer
from rig.sequencer.probe import Probe
from sim_backend.simulated import SimulatedRig
from tests.rig.scripted import ScriptedRig

DECLARED = Platform(0.0185, 0.06, 650.0)
SETS = planned([Sine(torque_nm=40.0, frequency_hz=3.0, duration_s=0.5)])


class Listener(Observer):
    def __init__(self) -> None:
        self.findings: list[str] = []

    def probed(self, finding: str) -> None:
        self.findings.append(finding)


class Watched(SimulatedRig):
    """Remembers what it was asked for, and may turn the gyro's sign."""

    def __init__(self, config: Config, sign: float = 1.0) -> None:
        super().__init__(config.simulated, 1000.0)
        self.sign = sign
        self.sent: list[tuple[float, float]] = []
        self.begun_s: list[float] = []

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        self.sent.append((now_s, torque_nm))
        reply = super().exchange(now_s, torque_nm)
        return reply._replace(gyro=[s._replace(rate_rad_s=self.sign * s.rate_rad_s) for s in reply.gyro])

    def begin_set(self, torque, start_s) -> None:  # type: ignore[no-untyped-def]
        self.begun_s.append(start_s)
        super().begin_set(torque, start_s)


def played(rig: Watched, observer: Observer | None = None, rest_s: float = 6.0) -> Campaign:
    config = Config(name="x", backend="simulated")
    guard = Guard(config.limits, motion_checks(config.limits, DECLARED))
    probe = Probe(ProbeConfig(), config.limits, DECLARED, SETS)
    return Sequencer(
        rig, VirtualClock(), guard, sample_rate_hz=1000, rest_s=rest_s, probe=probe, observer=observer
    ).play(SETS)


def platform(**more: object) -> Config:
    truth = {"inertia_kg_m2": 0.0203, "damping_nm_s_rad": 0.0447, "stiffness_nm_rad": 681.2, **more}
    return Config.model_validate({"name": "x", "backend": "simulated", "simulated": {"platform": truth}})


def test_the_probe_comes_first_is_small_and_the_set_starts_from_rest() -> None:
    listener, rig = Listener(), Watched(platform())
    campaign = played(rig, listener)
    assert campaign.cause is None
    assert "sign and scale are correct" in listener.findings[0]
    [start_s] = rig.begun_s
    before = [nm for at_s, nm in rig.sent if at_s < start_s]
    assert 0.1 < max(before) < 2.0
    assert all(nm == 0.0 for at_s, nm in rig.sent if start_s - 0.5 < at_s < start_s)
    [run] = campaign.recording.runs
    assert run.rate_rad_s is not None
    assert abs(run.rate_rad_s[0]) < 0.02


def test_a_platform_that_stops_at_once_is_not_waited_for() -> None:
    rubbing = Watched(platform(effects={"coulomb_friction": {"level_nm": 1.0}}))
    ringing = Watched(platform())
    assert played(rubbing).cause is None
    assert played(ringing).cause is None
    assert rubbing.begun_s[0] < 2.0 < ringing.begun_s[0] < 8.0


def test_what_the_probe_finds_wrong_ends_the_campaign_before_any_set() -> None:
    rig = Watched(platform(), sign=-1.0)
    campaign = played(rig)
    assert isinstance(campaign.cause, SafetyTrip)
    assert "opposite signs" in str(campaign.cause)
    assert campaign.recording.runs == ()
    assert rig.begun_s == []
    assert campaign.verdict_s is not None
    assert campaign.verdict_s == pytest.approx(rig.sent[-1][0], abs=0.01)


def test_sets_that_walk_away_from_where_the_campaign_began_end_at_the_travel_limit() -> None:
    turning = math.radians(13.0)

    def creeping(now_s: float) -> Exchange:
        rate = (turning if rig.torque_nm else 0.0) + math.radians(2.0) + 1e-3 * math.sin(1e4 * now_s)
        return Exchange((GyroSample(now_s, rate, True),), (TorqueSample(now_s, 0.0),))

    rig = ScriptedRig(creeping)
    sets = planned([Sine(torque_nm=10.0, frequency_hz=5.0, duration_s=0.5)] * 3)
    campaign = Sequencer(rig, VirtualClock(), Guard(LimitsConfig()), sample_rate_hz=1000, rest_s=1.0).play(sets)
    assert isinstance(campaign.cause, SafetyTrip)
    assert "travel (limits.travel_deg" in str(campaign.cause)
    assert [s.complete for s in campaign.statistics] == [True, False]
