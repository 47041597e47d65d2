"""The emulated bench: platform, gyroscope on one pseudo terminal, CAN adapter with a drive on another.

One thread, woken by bytes from the host and by the gyro's own clock. Torque changes take effect at the
instant their frame was read, or was sent where the machine kept this process from reading it (``overslept``);
the platform is then integrated up to each gyro sample.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Collection

import numpy as np

from drivers.codecs.lawicel import CanFrame
from rig.config.bench import InjectedFault
from rig.config.root import Config
from rig.errors import ConfigError
from sim_backend.emulators.adapter import LawicelAdapter
from sim_backend.emulators.device import EmulatedDrive, Event
from sim_backend.emulators.drive import Cia402Drive
from sim_backend.emulators.faults.schedule import FaultSchedule
from sim_backend.emulators.gyro import GYROS, AnyGyro, GyroSettings, flat_low_pass
from sim_backend.emulators.late_arrivals import REPORTED_PAUSE_S, ArrivalTimes
from sim_backend.emulators.odrive import OdriveAxis
from sim_backend.emulators.pty_port import PtyPort
from sim_backend.emulators.socket_port import SocketListener
from sim_backend.emulators.world import World

WORLD_STEPS_PER_SAMPLE = 20  # with half as many friction turns late under a torque's steps: K is 4e-6 too large
LONGEST_SLEEP_S = 0.002  # the promise of ``run``: ``stop`` is asked so often
DEFAULT_BAUD, DEFAULT_RATE_HZ = 921_600, 2000.0


def _make_gyro(config: Config) -> AnyGyro:
    assert config.bench is not None
    gyro, truth = config.bench.gyroscope, config.simulated.gyro
    if gyro.device not in GYROS:
        raise ConfigError(f"bench.gyroscope.device: {gyro.device!r} has no emulator: choose one of {', '.join(GYROS)}")
    return GYROS[gyro.device](
        GyroSettings(
            sample_rate_hz=gyro.sample_rate_hz or DEFAULT_RATE_HZ,
            baud=gyro.baud or DEFAULT_BAUD,
            axis=gyro.axis,
            invert=gyro.invert,
            noise_deg_s=truth.noise_deg_s,
            bias_deg_s=truth.bias_deg_s,
            drift_ppm=config.bench.emulator.gyro_drift_ppm,
            start_up_s=config.bench.emulator.start_up_s,
            seed=config.simulated.seed,
            settings=gyro.settings,
        )
    )


def _make_cia402(config: Config) -> EmulatedDrive:
    assert config.bench is not None
    e = config.bench.emulator
    return Cia402Drive(config.bench.amplifier.node, e.rated_torque_nm, e.peak_torque_nm, e.drive_drift_ppm)


def _make_odrive(config: Config) -> EmulatedDrive:
    assert config.bench is not None
    amplifier = config.bench.amplifier
    constant = float(amplifier.settings.get("torque_constant_nm_a", 1.0) or 1.0)
    peak = config.bench.emulator.peak_torque_nm
    return OdriveAxis(amplifier.node, peak, constant, amplifier.watchdog_ms * 1e-3)


Port = PtyPort | SocketListener
PORTS: dict[str, Callable[[], Port]] = {"terminal": PtyPort, "socket": SocketListener}
"""What the devices are reached through, by `bench.emulator.ports`."""

DRIVES: dict[str, Callable[[Config], EmulatedDrive]] = {"cia402": _make_cia402, "odrive": _make_odrive}
"""Emulated drives by the name of the driver that commands them."""


def _make_drive(config: Config) -> EmulatedDrive:
    assert config.bench is not None
    device = config.bench.amplifier.device
    if device not in DRIVES:
        raise ConfigError(f"bench.amplifier.device: {device!r} has no emulator: choose one of {', '.join(DRIVES)}")
    return DRIVES[device](config)


class EmulatedBench:
    """Both devices and the platform between them.

    Parameters
    ----------
    config
        A whole configuration with a `bench` section; truth and noise come from its `simulated` section.
    on_event
        Called with every event of the drive, as it happens.
    clock
        Seconds: the host's monotonic clock, or time that the bench lets pass (``sim_backend.emulators.in_step``).
    new_port
        Makes the ports; those that `bench.emulator.ports` names where left out.

    Raises
    ------
    ConfigError
        If the devices named there have no emulator.
    """

    def __init__(
        self,
        config: Config,
        on_event: Callable[[Event], None],
        clock: Callable[[], float] = time.monotonic,
        new_port: Callable[[], Port] | None = None,
    ) -> None:
        if config.bench is None:
            raise ConfigError("there is no `bench` section to emulate: add one that names the devices")
        self._gyro, self.drive = _make_gyro(config), _make_drive(config)
        self._faults = FaultSchedule(config.bench.emulator.faults, self._report_fault, config.simulated.seed, clock)
        emulator = config.bench.emulator
        rate_hz = config.bench.gyroscope.sample_rate_hz or DEFAULT_RATE_HZ
        self._period_s = 1.0 / rate_hz / (1.0 + emulator.gyro_drift_ppm * 1e-6)
        self._delay_s = emulator.drive_delay_ms * 1e-3
        self._sign = (-1.0 if config.bench.amplifier.invert else 1.0) * config.bench.amplifier.gear_ratio
        self._on_event, self._clock = on_event, clock
        step_s = self._period_s / WORLD_STEPS_PER_SAMPLE
        self._kernel = flat_low_pass(self._gyro.group_delay_s, self._gyro.filter_hz, step_s)
        self._window = np.zeros(2 * len(self._kernel))
        self._slot = 0
        self._adapter = LawicelAdapter(self._from_host, clock)
        self._arrivals = ArrivalTimes()
        self._new_port = new_port or PORTS[emulator.ports or "terminal"]
        self.gyro_port, self.can_port = self._new_port(), self._new_port()
        self._now_s = self._start_s = clock() + 0.05
        self._world = World(config.simulated.platform.platform(), self._start_s, step_s)
        self._samples = 0
        self._shaft_nm = 0.0

    def _from_host(self, frame: CanFrame) -> None:
        self.drive.receive(frame, self._now_s)

    def _report_fault(self, now_s: float, what: str) -> None:
        self._on_event(Event("injected", now_s, self.drive.torque_nm, self.drive.torque_nm, what))

    def inject(self, fault: InjectedFault) -> None:
        """Let a fault take hold from now on. Raises ConfigError for one that does not exist."""
        self._faults.plan(fault, self._clock())

    def unplug_gyro(self) -> None:
        """Its port vanishes."""
        self.gyro_port.close()

    def unplug_adapter(self) -> None:
        """Its port vanishes."""
        self.can_port.close()

    def replug_gyro(self) -> None:
        """Its port is there again, under another name, which is told."""
        self.gyro_port = self._new_port()
        self._report_fault(self._now_s, f"the gyro is plugged in again: {self.gyro_port.path}")

    def replug_adapter(self) -> None:
        """As ``replug_gyro``."""
        self.can_port = self._new_port()
        self._report_fault(self._now_s, f"the CAN adapter is plugged in again: {self.can_port.path}")

    def flag_gyro(self, status: int) -> None:
        """Set bits of its status byte."""
        self._gyro.flags = status

    def command_gyro(self, data: bytes) -> None:
        """As if the host had sent this to the gyro."""
        self._gyro.command(data)

    def freeze_gyro(self, frozen: bool) -> None:
        """Take its noise away, or give it back."""
        self._gyro.frozen = frozen

    def run(self, stop: Callable[[], bool]) -> None:
        """Emulate until ``stop()``, asked at least every 2 ms."""
        self._now_s = self._clock()
        while not stop():
            wait_s = min(max(self.next_sample_s() - self._clock(), 0.0), LONGEST_SLEEP_S)
            ports = [port for port in (self.can_port, self.gyro_port) if port.plugged_in]
            readable = select.select(ports, [], [], wait_s)[0]
            before_s = self._now_s
            self.pass_time(readable)
            if self._now_s - before_s > REPORTED_PAUSE_S:
                self._report_pause(self._now_s - before_s)

    def next_sample_s(self) -> float:
        """When the last bit of the gyro's next datagram is out."""
        lag_s = self._gyro.latency_s + self._gyro.transmission_s
        return self._start_s + (self._samples + 1) * self._period_s + lag_s

    def pass_time(self, readable: Collection[Port] = ()) -> None:
        """Whatever is due by now: faults, what the host has sent to these ports, the drive, the gyro's datagrams."""
        before_s, self._now_s = self._now_s, self._clock()
        self._faults.pass_time(self, self._now_s)
        if self.can_port in readable and self.can_port.plugged_in:
            self._receive_from_host(before_s)
        self._serve_drive(b"")
        if self.gyro_port in readable and self.gyro_port.plugged_in:
            self._gyro.command(self.gyro_port.read())
        self._send_samples()

    def _report_pause(self, paused_s: float) -> None:
        nm = self.drive.torque_nm
        what = f"this machine kept the emulators from running for {paused_s * 1e3:.1f} ms"
        self._on_event(Event("paused", self._now_s, nm, nm, what))

    def _receive_from_host(self, before_s: float) -> None:
        found_s = self._now_s
        for at_s, sent in self._arrivals.pieces(self.can_port.read(), before_s, found_s):
            self._now_s = at_s
            data = self._faults.to_adapter(sent) if sent else sent
            self._serve_drive(self._adapter.feed(data) if data else b"")
        self._now_s = found_s

    def _serve_drive(self, answer: bytes) -> None:
        now_s = self._now_s
        self.drive.tick(now_s)
        shaft_nm = self._faults.torque(self._sign * self.drive.torque_nm)
        if shaft_nm != self._shaft_nm:
            self._shaft_nm = shaft_nm
            self._world.change_torque(self.drive.acts_at(now_s) + self._delay_s, shaft_nm)
        out = answer + b"".join(self._adapter.to_host(frame) for frame in self.drive.take_frames())
        if out:
            self.can_port.write(self._faults.to_host(out))
        for event in self.drive.take_events(now_s):
            if event.name == "enabled":
                self._faults.enabled(event.time_s)
            self._on_event(event)

    def _send_samples(self) -> None:
        while self.next_sample_s() <= self._now_s:
            self._remember([self._faults.rate(rate) for rate in self._world.advance(WORLD_STEPS_PER_SAMPLE)])
            self._samples += 1
            self.gyro_port.write(self._faults.gyro_bytes(self._gyro.sample(self._filtered())))

    def _remember(self, rates_rad_s: list[float]) -> None:
        # Written twice, so that the last len(kernel) values always stand side by side.
        n = len(self._kernel)
        while rates_rad_s:
            slot, part = self._slot, rates_rad_s[: n - self._slot]
            end = slot + len(part)
            self._window[slot:end] = self._window[slot + n : end + n] = part
            self._slot = end % n
            rates_rad_s = rates_rad_s[len(part) :]

    def _filtered(self) -> float:
        return float(self._kernel @ self._window[self._slot : self._slot + len(self._kernel)])

    def close(self) -> None:
        """Unplug both devices."""
        self.gyro_port.close()
        self.can_port.close()
