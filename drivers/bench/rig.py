"""The bench: a gyroscope on a serial port and an amplifier on CAN as one rig.

One thread does everything, in the order of a tick: torque out first, so that its instant is that of the
tick; then what the gyro and the drive have sent; then the drive's own verdict. The drive's watchdog is fed
by the same frames as the torque, so a loop that hangs looks dead to the drive.
"""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path

from drivers.amplifiers import make_amplifier
from drivers.amplifiers.base import Amplifier
from drivers.bench.device_rig import DeviceRig
from drivers.bench.devices import BenchDevices
from drivers.bench.retiming import BenchRetiming, takes_reported
from drivers.capture.wire_capture import Capture, export
from drivers.gyroscopes import make_gyroscope
from drivers.gyroscopes.gyro_line import GyroReport
from drivers.timing.bench_clock import BenchClock
from drivers.transport.can_link import CanLink
from rig import realtime
from rig.clock import HostClock, MonotonicClock
from rig.config.bench import BenchConfig, ProbeConfig
from rig.errors import DeviceFault, RigError
from rig.interface import (
    Exchange,
    GyroSample,
    Statement,
    Torque,
    TorqueOfTime,
    TorqueSample,
)


@dataclass(frozen=True)
class BenchReport:
    """What the bench found out about itself, for `rig check`, the report and recording.h5."""

    gyro: GyroReport
    amplifier_notes: tuple[str, ...]
    real_time: str
    emergencies: tuple[str, ...] = ()


class BenchRig(DeviceRig):
    """A rig made of devices.

    Parameters
    ----------
    config
        The `bench` section.
    torque
        REAL, or EMULATED where the ports are those of emulators.
    raw_folder
        Where the raw capture goes, or None for none.
    clock
        The host's; its monotonic one where left out.

    Raises
    ------
    ConfigError
        If a driver is unknown or does not accept its settings.
    """

    def __init__(
        self,
        config: BenchConfig,
        torque: Torque,
        raw_folder: Path | None = None,
        clock: HostClock | None = None,
    ) -> None:
        self._config = config
        self._torque = torque
        self._raw_folder = raw_folder if config.raw_capture else None
        spin_s = config.real_time.spin_us * 1e-6
        self._host = clock or MonotonicClock(spin_s)
        self.gyroscope = make_gyroscope(config.gyroscope)
        self.amplifier: Amplifier = make_amplifier(config.amplifier)
        self._retiming = BenchRetiming(config.amplifier, self.gyroscope, self.amplifier)
        self._capture: Capture | None = None
        self._devices: BenchDevices | None = None
        self._armed = False
        self._grant: realtime.RealTimeGrant | None = None
        self.clock = BenchClock(self._listen, self._host, spin_s, self._note_clock)

    def statement(self) -> Statement:
        """Both devices with their ports."""
        gyro, amplifier = self._config.gyroscope, self._config.amplifier
        return Statement(
            self._torque,
            (
                f"{self.amplifier.label} on {amplifier.can.interface} {amplifier.can.channel}",
                f"{self.gyroscope.label} on {gyro.port}",
            ),
        )

    @property
    def probe(self) -> ProbeConfig | None:
        """As the file has it."""
        return self._config.probe if self._config.probe.play else None

    # -- contact ---------------------------------------------------------------------------------

    def open(self) -> None:
        """Real-time priority as far as granted; both devices contacted, the gyro's clock settled.

        Every failure is listed at once.

        Raises
        ------
        DeviceFault
            With all that failed and the cures.
        ConfigError
            If a port is not named.
        """
        # Before a device is contacted: locking the memory takes half a second, in which a buffer overflows.
        real_time = self._config.real_time
        self._grant = realtime.acquire(real_time.priority, real_time.lock_memory)
        if self._raw_folder is not None:
            self._capture = Capture(self._raw_folder)
            self._capture.start()
            self._mark("config", {"bench": self._config.model_dump(mode="json")})
        self._devices = BenchDevices(self._config, self.gyroscope, self.amplifier, self._capture, self._host)
        self._devices.contact()
        self._mark("opened")

    def _listen(self, timeout_s: float) -> bool:
        return self._devices is not None and self._devices.listen(timeout_s)

    @property
    def _link(self) -> CanLink | None:
        return None if self._devices is None else self._devices.link

    # -- torque ----------------------------------------------------------------------------------

    def arm(self) -> None:
        """The drive enabled at zero torque, its watchdog running. Raises Aborted where the disk is full already."""
        devices = self._devices
        if devices is None or devices.link is None:
            raise DeviceFault("the bench is armed before it is open: open it first")
        if self._capture is not None:
            self._capture.require_written()  # a disk that is full already is known before there is torque
        self._armed = True
        self.amplifier.arm(devices.link)
        devices.gather()
        devices.waiting.clear()
        self.amplifier.take_reported()
        self._mark("armed", {"real_time": str(self._grant)})

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """One tick. Raises DeviceFault if a device failed; then nothing more is sent."""
        devices = self._devices
        if not self._armed or devices is None or devices.link is None or devices.line is None:
            raise DeviceFault("torque was sent to a bench that is not armed: arm it first")
        link, line = devices.link, devices.line
        fault = line.fault or devices.link_fault
        if fault is not None:
            raise fault
        amplifier = self.amplifier
        frames = amplifier.frames(torque_nm, now_s)
        sent_s = link.send(frames)
        sent = [nm for frame in frames if (nm := amplifier.sent_torque_nm(frame)) is not None]
        gyro = devices.waiting + line.collect() if devices.waiting else line.collect()
        devices.waiting.clear()
        link.poll()
        amplifier.check(now_s)
        if self._capture is not None:
            self._capture.tick(now_s, torque_nm)
        self._retiming.tick()
        if self._capture is not None:
            self._capture.flush_if_due(now_s)
        return exchange_of(self._config, amplifier, gyro, [TorqueSample(sent_s, nm) for nm in sent])

    def torque_off(self) -> None:
        """Zero torque now. Safe at any time, twice, and from a signal handler."""
        if self._armed and self._link is not None:
            self._link.send(self.amplifier.off_frames(), urgent=True)

    def disarm(self) -> None:
        """Zero torque, disable, verify by reading back."""
        if not self._armed or self._link is None:
            return
        self._armed = False
        try:
            self.amplifier.disarm(self._link)
            self._mark("disarmed")
        except DeviceFault as fault:
            raise DeviceFault(
                f"the drive could not be shown to be off: {fault} Its own watchdog cuts the torque "
                f"{self._config.amplifier.watchdog_ms} ms after the last frame. Check the drive before you approach "
                "the machine."
            ) from None

    def close(self) -> None:
        """Let go of both ports and finish the capture; safe twice.

        A capture that cannot be finished raises Aborted or OSError, but not on the way out of another error: what
        ended the campaign decides.
        """
        under_way = sys.exception()
        try:
            if self._devices is not None:
                self._devices.close()
        finally:
            if self._grant is not None:
                realtime.release()
            if self._capture is not None:
                self._finish_capture(self._capture, quietly=under_way is not None)

    def _finish_capture(self, capture: Capture, quietly: bool) -> None:
        self._capture = None
        with contextlib.suppress(*((RigError, OSError) if quietly else ())):
            capture.close()
            export(capture.path)

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:
        """Marks the capture; the clocks keep what is needed to stamp the set anew."""
        self._mark("begin_set", {"start_s": start_s})
        self._retiming.begin_set(start_s)

    def end_set(self) -> None:
        """Marks the capture."""
        self._mark("end_set")
        self._retiming.end_set()

    # -- account ---------------------------------------------------------------------------------

    def report(self) -> BenchReport:
        """What is known of the devices so far. Raises DeviceFault before the bench was open."""
        devices = self._devices
        if devices is None or devices.line is None:
            raise DeviceFault("the bench was never opened and has nothing to report")
        return BenchReport(
            devices.line.report(),
            tuple(devices.notes),
            str(self._grant) if self._grant is not None else "not open yet",
            self.amplifier.emergencies.describe(lambda one: one[1]),
        )

    def _mark(self, what: str, values: dict[str, object] | None = None) -> None:
        if self._capture is not None:
            self._capture.mark(self._host.now_s(), what, values)

    def _note_clock(self, time_s: float) -> None:
        if self._capture is not None:
            self._capture.clock(time_s)


def exchange_of(
    config: BenchConfig,
    amplifier: Amplifier,
    gyro: list[GyroSample],
    sent: list[TorqueSample],
) -> Exchange:
    """What a tick gives back, on the bench and in a replay alike."""
    reported = amplifier.take_reported()
    actual = amplifier.actual_torque_nm
    if actual is None:
        return Exchange(gyro, sent, amplifier.readings)
    channels = {"drive_torque_nm": actual, "sent_torque_nm": sent[-1].torque_nm if sent else 0.0}
    channels |= amplifier.readings
    from_drive = takes_reported(config.amplifier, amplifier)
    return Exchange(gyro, reported if from_drive else sent, channels)
