"""The bench: a gyroscope on a serial port and an amplifier on CAN as one rig.

One thread does everything, in the order of a tick: torque out first, so that its instant is that of the
tick; then what the gyro and the drive have sent; then the drive's own verdict. The drive's watchdog is fed
by the same frames as the torque, so a loop that hangs looks dead to the drive.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from drivers.amplifiers import make_amplifier
from drivers.amplifiers.base import Amplifier
from drivers.bench_clock import BenchClock
from drivers.can_link import CanLink, open_bus
from drivers.capture import Capture, export
from drivers.gyro_line import GyroLine, GyroReport
from drivers.gyroscopes import make_gyroscope
from drivers.listening import ListeningPort
from drivers.ports import SerialPort
from rig import realtime
from rig.config.bench import BenchConfig
from rig.errors import ConfigError, DeviceFault, RigError
from rig.interface import Exchange, GyroSample, LowPass, Rig, Statement, Torque, TorqueOfTime, TorqueSample
from rig.recording.run import TorqueHold

CONTACT_TIME_S = 0.002


@dataclass(frozen=True)
class BenchReport:
    """What the bench found out about itself, for `rig check`, the report and recording.h5.

    ``delay_between_tick_and_torque`` is what the drivers expect of the torque path: nothing is known, so
    the identifier's ``torque_delay`` is to be compared with zero.
    """

    gyro: GyroReport
    amplifier_notes: tuple[str, ...]
    real_time: str
    emergencies: tuple[str, ...] = ()


class BenchRig(Rig):
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
        Host time in seconds.

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
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config = config
        self._torque = torque
        self._raw_folder = raw_folder if config.raw_capture else None
        self._time = clock
        self.gyroscope = make_gyroscope(config.gyroscope)
        self.amplifier: Amplifier = make_amplifier(config.amplifier)
        self._capture: Capture | None = None
        self._line: GyroLine | None = None
        self._link: CanLink | None = None
        self._armed = False
        self._grant: realtime.RealTimeGrant | None = None
        self._notes: list[str] = []
        self._waiting: list[GyroSample] = []
        self._settle_due_s = 0.0
        self._link_fault: DeviceFault | None = None
        self.clock = BenchClock(self._listen, config.real_time.spin_us * 1e-6, self._note_clock, clock)

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
    def torque_hold(self) -> TorqueHold:
        """A set point is held until the next."""
        return "zero_order"

    @property
    def noise_rad_s(self) -> float | None:
        """As the gyro's data sheet has it."""
        return self.gyroscope.noise_rad_s

    @property
    def rate_low_pass(self) -> LowPass | None:
        """Of the gyroscope."""
        return self.gyroscope.low_pass

    @property
    def rate_full_scale_rad_s(self) -> float | None:
        """Of the gyroscope."""
        return self.gyroscope.full_scale_rad_s

    @property
    def rate_full_scale_key(self) -> str:
        """The device decides, by its data sheet."""
        return "bench.gyroscope.device"

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
        begin_s = self._time()
        faults = [fault for fault in (self._open_gyro(), self._open_drive()) if fault is not None]
        if self._line is not None:
            while self._time() - begin_s < self._config.settle_s:
                time.sleep(CONTACT_TIME_S)
                self._gather(faults)
                self._settle_drive(faults)
            self._line.note_noise()
            faults += [DeviceFault(text) for text in self._line.problems(self._time() - begin_s)]
        if faults:
            raise _together(faults)
        self._mark("opened")

    def _open_gyro(self) -> RigError | None:
        port = self._config.gyroscope.port
        if port is None:
            return ConfigError(
                "bench.gyroscope.port is empty: name its serial port (`rig devices` lists them) or run with --emulate"
            )
        try:
            serial = ListeningPort(SerialPort(port, self.gyroscope.baud), self._time)
            self._line = GyroLine(self.gyroscope, serial, self._capture, self._time)
            self._line.greet()
        except RigError as fault:
            return fault
        return None

    def _open_drive(self) -> RigError | None:
        try:
            self._link = CanLink(open_bus(self._config.amplifier.can), self._time)
            self._link.idle = lambda: self._gather([])
            self._link.on_sent = self.amplifier.note_sent
            self._link.record = self._capture.can if self._capture is not None else None
            self._notes = self.amplifier.contact(self._link)
        except RigError as fault:
            return fault
        return None

    def _settle_drive(self, faults: list[RigError]) -> None:
        if self._link is None or faults or self._time() < self._settle_due_s:
            return
        self._settle_due_s = self._time() + CONTACT_TIME_S
        try:
            self.amplifier.settle(self._link)
            self._link.poll()
        except RigError as fault:
            faults.append(fault)

    def _gather(self, faults: list[RigError]) -> None:
        """Decode what has arrived, so that no buffer overflows; samples wait for the next exchange."""
        if self._line is None or self._line.fault is not None:
            return
        try:
            self._waiting += self._line.collect()
        except DeviceFault as fault:
            faults.append(fault)
        if len(self._waiting) > 2000:
            del self._waiting[:-1000]  # while nothing is played only the newest matter

    def _listen(self, timeout_s: float) -> bool:
        """Wait for a bus that has no ear of its own, and stamp its frames as they arrive; False if none came."""
        link = self._link
        descriptor = -1 if link is None or self._link_fault is not None else link.fileno()
        if link is None or descriptor < 0 or not select.select((descriptor,), (), (), timeout_s)[0]:
            return False
        try:
            link.poll()
        except DeviceFault as fault:
            self._link_fault = fault
        return True

    # -- torque ----------------------------------------------------------------------------------

    def arm(self) -> None:
        """The drive enabled at zero torque, its watchdog running."""
        if self._link is None:
            raise DeviceFault("the bench is armed before it is open: open it first")
        self._armed = True
        self.amplifier.arm(self._link)
        self._gather([])
        self._waiting.clear()
        self.amplifier.take_reported()
        self._mark("armed", {"real_time": str(self._grant)})

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """One tick. Raises DeviceFault if a device failed; then nothing more is sent."""
        link, line = self._link, self._line
        if not self._armed or link is None or line is None:
            raise DeviceFault("torque was sent to a bench that is not armed: arm it first")
        fault = line.fault or self._link_fault
        if fault is not None:
            raise fault
        amplifier = self.amplifier
        frames = amplifier.frames(torque_nm, now_s)
        sent_s = link.send(frames)
        sent = [nm for frame in frames if (nm := amplifier.sent_torque_nm(frame)) is not None]
        gyro = self._waiting + line.collect() if self._waiting else line.collect()
        self._waiting.clear()
        link.poll()
        amplifier.check(now_s)
        if self._capture is not None:
            self._capture.tick(now_s, torque_nm)
            self._capture.flush_if_due(now_s)
        return answer(self._config, amplifier, gyro, [TorqueSample(sent_s, nm) for nm in sent])

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
                f"{self._config.amplifier.watchdog_ms} ms after the last frame; check before you go near."
            ) from None

    def close(self) -> None:
        """Let go of both ports and finish the capture; safe twice."""
        try:
            for device in (self._link, self._line):
                if device is not None:
                    device.close()
        finally:
            self._link = None
            if self._grant is not None:
                realtime.release()
            if self._capture is not None:
                self._capture.close()
                export(self._capture.path)
                self._capture = None

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:
        """Marks the capture."""
        self._mark("begin_set", {"start_s": start_s})

    def end_set(self) -> None:
        """Marks the capture."""
        self._mark("end_set")

    # -- account ---------------------------------------------------------------------------------

    def report(self) -> BenchReport:
        """What is known of the devices so far. Raises DeviceFault before the bench was open."""
        if self._line is None:
            raise DeviceFault("there is nothing to report of a bench that was never open")
        emergencies = getattr(self.amplifier, "emergencies", [])
        return BenchReport(
            self._line.report(),
            tuple(self._notes),
            str(self._grant) if self._grant is not None else "not open yet",
            tuple(text for _, text in emergencies),
        )

    def _mark(self, what: str, values: dict[str, object] | None = None) -> None:
        if self._capture is not None:
            self._capture.mark(self._time(), what, values)

    def _note_clock(self, time_s: float) -> None:
        if self._capture is not None:
            self._capture.clock(time_s)


def answer(
    config: BenchConfig,
    amplifier: Amplifier,
    gyro: list[GyroSample],
    sent: list[TorqueSample],
) -> Exchange:
    """What a tick gives back, on the bench and in a replay alike."""
    reported = amplifier.take_reported()
    actual = amplifier.actual_torque_nm
    if actual is None:
        return Exchange(gyro, sent)
    source = config.amplifier.torque_source
    from_drive = source == "actual" or (source == "auto" and amplifier.stamps_torque)
    channels = {"drive_torque_nm": actual, "sent_torque_nm": sent[-1].torque_nm if sent else 0.0}
    return Exchange(gyro, reported if from_drive else sent, channels)


def _together(faults: list[RigError]) -> RigError:
    """One error that lists all; a usage error only where nothing else is wrong."""
    if len(faults) == 1:
        return faults[0]
    text = "\n".join(f"  {fault}" for fault in faults)
    kind = ConfigError if all(isinstance(fault, ConfigError) for fault in faults) else DeviceFault
    return kind(f"{len(faults)} things are wrong on the bench:\n{text}")
