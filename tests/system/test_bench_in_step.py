"""The bench in step with its emulated devices: real drivers and real bytes in a time that no computer can be late in.

The emulators run in a thread here, over the same sockets as in their own process; that one is started once, at the end.
"""

import contextlib
import signal
import socket
import sys
import threading
import time

import numpy as np
import pytest

from drivers.bench import BenchRig
from drivers.transport.slcan import MAX_ANSWER_S
from rig.config.load import load_config
from rig.errors import ConfigError, DeviceFault
from rig.guard import Guard
from rig.interface import Torque
from rig.preflight import plan
from rig.sequencer import Sequencer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="emulators need local sockets")

SHORT = (
    "bench.emulator.clock=in_step", "bench.settle_s=0.5", "bench.emulator.start_up_s=0.1", "excitation.rest_s=0.2",
    "excitation.sets=[{torque_nm: 40, frequency_hz: 5, duration_s: 0.4}]",
)  # fmt: skip
WATCHDOG_S, BEAT_S = 0.100, 0.025


@pytest.fixture
def configured(request):
    path = request.config.rootpath / "examples" / "bench.yaml"
    return lambda *more: load_config(path, [*SHORT, *more]).config


class Bench:
    """A bench, its clock, and what its emulated drive did."""

    def __init__(self, config, patience_s):
        from sim_backend.emulators.in_step.clock import InStepClock  # noqa: PLC0415  POSIX only
        from sim_backend.emulators.in_step.messages import Channel  # noqa: PLC0415
        from sim_backend.emulators.in_step.stepper import Stepper  # noqa: PLC0415
        from sim_backend.emulators.launch import on_emulated_ports  # noqa: PLC0415

        ours, theirs = map(Channel, socket.socketpair())
        self.events, self.stop = [], threading.Event()
        self.other_end, self.stepper = theirs, Stepper(config, self.events.append, theirs, patience_s)
        self.devices = self.stepper.bench
        ports = (self.devices.gyro_port.path, self.devices.can_port.path)
        self.clock, self.config = InStepClock(ours), config
        section = on_emulated_ports(config, _Ports(*ports)).bench
        self.rig = BenchRig(section, Torque.EMULATED, clock=self.clock)
        self.thread = threading.Thread(target=self.stepper.run, args=(self.stop.is_set,))
        self.thread.start()

    def ended(self):
        """Both ends let go; the emulators are given their time to switch off."""
        self.clock.close()
        self.thread.join(20.0)
        self.other_end.close()
        self.devices.close()
        return not self.thread.is_alive()

    def at(self, name):
        """When the drive first did that."""
        return next(event.time_s for event in self.events if event.name == name)


class _Ports:
    def __init__(self, gyro, can):
        self.gyro, self.can = gyro, can


@contextlib.contextmanager
def in_step(config, patience_s=20.0):
    bench = Bench(config, patience_s)
    try:
        yield bench
    finally:
        assert bench.ended()


def played(bench, torque=lambda torque: torque):
    config, rig = bench.config, bench.rig
    sets = plan(config.model.platform(), config.excitation, config.limits, rig.rate_full_scale_rad_s)
    keep = rig.exchange
    rig.exchange = lambda now_s, nm: keep(now_s, torque(nm))
    return Sequencer(rig, rig.clock, Guard(config.limits), sample_rate_hz=1000, rest_s=config.excitation.rest_s).play(
        sets
    )


def hold(rig, ticks, torque_nm=2.0):
    for _ in range(ticks):
        now_s = rig.clock.now_s()
        rig.exchange(now_s, torque_nm)
        rig.clock.wait_until(now_s + 1e-3)


ARRAYS = ("time_s", "rate_rad_s", "valid", "torque_time_s", "torque_nm")


def test_no_tick_is_late_because_the_computer_is_and_a_seed_gives_one_recording(configured):
    runs = []
    slow = iter([0.03, 0.06])  # s for which the loop stands still, in two of its ticks

    def sometimes_slow(torque_nm):
        if torque_nm > 20.0:
            time.sleep(next(slow, 0.0))
        return torque_nm

    for seed, torque in ((1, lambda nm: nm), (1, sometimes_slow), (2, lambda nm: nm)):
        with in_step(configured(f"simulated.seed={seed}")) as bench:
            campaign = played(bench, torque)
            assert campaign.cause is None
            (statistics,) = campaign.statistics
            assert statistics.missed_ticks == 0
            assert statistics.late.max_s == 0.0
            assert bench.rig.report().gyro.lost == 0
            runs.append(campaign.recording.runs[0])
    assert next(slow, None) is None, "both stalls happened"
    assert all(np.array_equal(getattr(runs[0], name), getattr(runs[1], name), equal_nan=True) for name in ARRAYS)
    assert not np.array_equal(runs[0].rate_rad_s, runs[2].rate_rad_s)
    # The torque acts when it was sent, within a microsecond of the drive's clock, every tick.
    gaps_s = np.diff(runs[0].torque_time_s)
    assert np.max(np.abs(gaps_s - 1e-3)) < 2.1e-6


def test_the_drive_cuts_a_loop_that_lets_its_watchdog_pass_by_emulated_time(configured):
    with in_step(configured()) as bench:
        rig = bench.rig
        with pytest.raises(DeviceFault, match=r"no longer hears this computer|left 'operation enabled'"), rig.opened():
            rig.arm()
            hold(rig, 20)
            last_s = rig.clock.now_s()
            rig.clock.wait_until(last_s + 0.2)
            hold(rig, 50)
        assert bench.at("watchdog") == pytest.approx(last_s + WATCHDOG_S, abs=BEAT_S + 0.003)
        assert bench.devices.drive.torque_nm == 0.0


def test_a_bench_that_is_gone_leaves_no_torque(configured):
    with in_step(configured()) as bench:
        bench.rig.open()
        bench.rig.arm()
        hold(bench.rig, 5)
        assert bench.devices.drive.torque_nm == pytest.approx(2.04, abs=0.07)
        bench.clock.close()  # as when its process is killed
        bench.thread.join(20.0)
        assert not bench.thread.is_alive()
        assert bench.devices.drive.torque_nm == 0.0
        assert {"watchdog", "torque_zero"} <= {event.name for event in bench.events}
        with pytest.raises(DeviceFault):
            bench.rig.close()
            bench.clock.pause(1e-3)


def test_a_bench_that_hangs_finds_the_drive_off(configured):
    with in_step(configured(), patience_s=0.3) as bench:
        rig = bench.rig
        with pytest.raises(DeviceFault, match=r"no longer hears this computer|left 'operation enabled'"), rig.opened():
            rig.arm()
            hold(rig, 5)
            end_s = time.monotonic() + 10.0
            while bench.devices.drive.torque_nm and time.monotonic() < end_s:
                time.sleep(0.01)
            assert bench.devices.drive.torque_nm == 0.0
            hold(rig, 50)


def test_time_waits_for_a_bench_that_takes_its_time_without_torque(configured):
    with in_step(configured(), patience_s=0.05) as bench, bench.rig.opened(), bench.rig.armed():
        before_s = bench.clock.now_s()
        time.sleep(0.3)
        bench.clock.wait_until(before_s + 1e-3)
        assert bench.clock.now_s() == before_s + 1e-3


def failing(configured, fault, cause):
    """When a bench ended whose devices fail so 0.05 s after the drive was enabled, and when that was."""
    with in_step(configured(f"bench.emulator.faults=[{{fault: {fault}, after_s: 0.05}}]")) as bench:
        rig = bench.rig
        with pytest.raises(DeviceFault, match=cause), rig.opened(), rig.armed():
            hold(rig, 200)
        return rig.clock.now_s(), bench.at("injected"), bench.at("enabled")


def test_a_device_is_unplugged_at_one_emulated_instant_whatever_the_computer_does(configured):
    first = failing(configured, "gyro_unplugged", "has vanished")
    assert first[1] == pytest.approx(first[2] + 0.05, abs=2e-3)
    assert failing(configured, "gyro_unplugged", "has vanished") == first


def test_time_outs_of_drivers_pass_by_emulated_time(configured):
    ended_s, injected_s, _ = failing(configured, "adapter_stalls", "unanswered for .* ms")
    assert MAX_ANSWER_S < ended_s - injected_s < MAX_ANSWER_S + 2.0, "then the drive is given its time to be seen off"


@pytest.mark.parametrize("strike", ["bench", pytest.param("emulators", marks=pytest.mark.slow)])
def test_a_process_that_is_gone_leaves_no_torque_and_no_one_waiting(configured, strike):
    from sim_backend.emulators.launch import on_emulated_ports, started  # noqa: PLC0415  POSIX only

    config = configured("bench.real_time.priority=50")
    with started(config) as emulators:
        section = on_emulated_ports(config, emulators).bench
        assert section.real_time.priority == 0, "what runs as fast as it can does not run before all others"
        rig = BenchRig(section, Torque.EMULATED, clock=emulators.clock)
        with pytest.raises(DeviceFault, match=r"have ended|has vanished"), rig.opened(), rig.armed():
            hold(rig, 5)
            if strike == "bench":
                emulators.clock.close()
                assert emulators.process.wait(20.0) == 0
                assert [e["event"] for e in emulators.events()][:2] == ["enabled", "watchdog"]
            else:
                emulators.process.send_signal(signal.SIGKILL)
            hold(rig, 5)


def test_a_clock_that_nobody_can_keep_in_step_is_refused_in_plain_words(configured):
    with pytest.raises(ConfigError, match=r"bench\.emulator.*clock: in_step needs ports: socket"):
        configured("bench.emulator.ports=terminal")
    with pytest.raises(ConfigError, match=r"bench\.emulator\.clock.*in_step"):
        configured("bench.emulator.clock=stepped")
    from sim_backend.emulators.process import run_emulators  # noqa: PLC0415  POSIX only

    with pytest.raises(ConfigError, match=r"bench\.emulator\.clock is in_step: that needs a bench"):
        run_emulators(configured())
