"""The bench against emulators in another process: real bytes, real time, a few seconds."""

import os
import signal
import sys
import time

import numpy as np
import pytest

from drivers.bench import BenchRig
from drivers.replay import ReplayRig
from rig.config.load import load_config
from rig.errors import DeviceFault, SafetyTrip
from rig.guard import Guard
from rig.interface import Torque
from rig.preflight import plan
from rig.sequencer import Sequencer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="emulators need pseudo terminals")

SETS = (
    "excitation.sets=[{torque_nm: 60, frequency_hz: 3, duration_s: 1}, {torque_nm: 30, frequency_hz: 6, duration_s: 1}]"
)
# A test machine may be busy: what is asserted is the account of missed ticks, never their absence.
PATIENT = (
    "limits.missed_ticks=200", "limits.stall_ms=50", "limits.stale_gyro_ms=500", "limits.rate_deg_s=1000",
    "bench.amplifier.settings.drive_heartbeat_ms=1000",
)  # fmt: skip
# Also what it looks like from the other side: a drive that heard nothing for 100 ms cuts the torque.
OF_A_STALL = ("stall", "missed ticks", "stale", "no longer hears this computer", "left 'operation enabled'")


@pytest.fixture
def config(request):
    path = request.config.rootpath / "examples" / "bench.yaml"
    return load_config(path, [SETS, "excitation.rest_s=0.5", "bench.settle_s=2", *PATIENT]).config


@pytest.fixture
def emulators(config):
    from sim_backend.emulators.launch import started  # noqa: PLC0415  POSIX only

    with started(config) as running:
        yield running
    assert running.process.returncode is not None


def make(config, emulators, raw=None):
    from sim_backend.emulators.launch import on_emulated_ports  # noqa: PLC0415

    section = on_emulated_ports(config, emulators).bench
    return BenchRig(section, Torque.EMULATED, raw)


def played(config, rig, **kwargs):
    sets = plan(config.model.platform(), config.excitation, config.limits, rig.rate_full_scale_rad_s)
    guard = Guard(config.limits)
    sequencer = Sequencer(
        rig, rig.clock, guard, sample_rate_hz=config.excitation.sample_rate_hz,
        rest_s=config.excitation.rest_s, **kwargs,
    )  # fmt: skip
    return sequencer.play(sets)


def test_campaign_in_real_time_loses_no_datagram_accounts_for_every_tick_and_replays(config, emulators, tmp_path):
    for attempt in range(5):  # a machine that others use may stall, and a stall is rightly a trip or a fault
        folder = tmp_path / str(attempt)
        folder.mkdir()
        rig = make(config, emulators, folder)
        campaign = played(config, rig)
        if campaign.cause is None or not any(text in str(campaign.cause) for text in OF_A_STALL):
            break
    assert campaign.cause is None
    report = rig.report()
    assert report.gyro.lost == 0
    assert report.gyro.dropped_bytes == 0
    for run, statistics in zip(campaign.recording.runs, campaign.statistics, strict=True):
        assert statistics.late.ticks + statistics.missed_ticks == pytest.approx(1001, abs=2)
        assert len(run.time_s) == pytest.approx(2000, abs=20)
        assert np.all(np.diff(run.time_s) > 0)
        assert np.max(np.abs(run.torque_nm)) > 20.0
    names = [event["event"] for event in emulators.events()]
    assert "enabled" in names
    assert names[-1] == "disabled" or "disabled" in names
    assert attempt > 0 or "watchdog" not in names

    replay = ReplayRig(folder / "wire.cap")
    again = played(config, replay)
    assert again.cause is None
    for a, b in zip(campaign.recording.runs, again.recording.runs, strict=True):
        for name in ("time_s", "rate_rad_s", "valid", "torque_time_s", "torque_nm"):
            assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)


def test_guard_takes_the_torque_off_within_20_ms_of_its_verdict(config, emulators):
    rig = make(config, emulators)
    tight = config.model_copy(update={"limits": config.limits.model_copy(update={"rate_deg_s": 60.0})})
    verdict_s = []
    keep = rig.torque_off
    rig.torque_off = lambda: (verdict_s.append(time.monotonic()), keep())
    # Planned with the wide limits, guarded with the tight ones: the guard has to trip.
    sets = plan(config.model.platform(), config.excitation, config.limits, rig.rate_full_scale_rad_s)
    campaign = Sequencer(rig, rig.clock, Guard(tight.limits), sample_rate_hz=1000, rest_s=0.5).play(sets)
    assert isinstance(campaign.cause, SafetyTrip)
    assert "limits.rate_deg_s" in str(campaign.cause)
    zero_s = next(float(e["time_s"]) for e in emulators.events() if e["event"] == "torque_zero")
    assert zero_s - verdict_s[0] < 0.020


def test_stopped_process_is_cut_off_by_the_drive_within_its_watchdog(config, emulators):
    rig = make(config, emulators)
    with pytest.raises(DeviceFault, match=r"no longer hears this computer|left 'operation enabled'"), rig.opened():
        rig.arm()
        last_s = 0.0
        for _ in range(50):
            last_s = rig.clock.now_s()
            rig.exchange(last_s, 20.0)
            rig.clock.wait_until(last_s + 1e-3)
        time.sleep(0.2)  # the loop hangs, its process and any thread of it alive
        for _ in range(50):
            now_s = rig.clock.now_s()
            rig.exchange(now_s, 20.0)
            rig.clock.wait_until(now_s + 1e-3)
    zero_s = next(float(e["time_s"]) for e in emulators.events() if e["event"] == "torque_zero")
    assert zero_s - last_s < 0.100 + 0.025 + 0.020, "watchdog time, one heartbeat interval and 20 ms"


def test_unplugged_devices_are_faults_and_nothing_is_left_running(config, emulators):
    rig = make(config, emulators)
    with pytest.raises(DeviceFault), rig.opened(), rig.armed():
        os.kill(emulators.process.pid, signal.SIGKILL)
        for _ in range(2000):
            now_s = rig.clock.now_s()
            rig.exchange(now_s, 1.0)
            rig.clock.wait_until(now_s + 1e-3)


def test_emulators_that_cannot_start_say_why(config):
    from sim_backend.emulators.launch import started  # noqa: PLC0415

    gyroscope = config.bench.gyroscope.model_copy(update={"device": "kvh1750"})
    bench = config.bench.model_copy(update={"gyroscope": gyroscope})
    refused = pytest.raises(DeviceFault, match="'kvh1750' has no emulator: choose one of stim300, vectornav")
    with refused, started(config.model_copy(update={"bench": bench})):
        pass
