"""The two devices of a bench on their ports: opened, contacted, read, closed."""

from __future__ import annotations

import contextlib
import select

from drivers.amplifiers.base import Amplifier
from drivers.capture.wire_capture import Capture
from drivers.gyroscopes.base import Gyroscope
from drivers.gyroscopes.gyro_line import GyroLine
from drivers.transport.can_link import CanLink, open_bus
from drivers.transport.in_step import listening
from drivers.transport.socket_port import open_port
from rig.clock import HostClock
from rig.config.bench import BenchConfig
from rig.errors import Aborted, ConfigError, DeviceFault, RigError
from rig.interface import GyroSample

CONTACT_TIME_S = 0.002  # between two looks at both devices
MAX_WAITING_SAMPLES, NEWEST_SAMPLES_KEPT = 2000, 1000  # samples, while nothing is played and only the newest matter


class BenchDevices:
    """A gyroscope on its line and an amplifier on its link, as far as they could be reached.

    Parameters
    ----------
    config
        The `bench` section.
    gyroscope, amplifier
        Their protocols.
    capture
        Where all that crosses the wire is kept, or None.
    clock
        The host's.
    """

    def __init__(
        self,
        config: BenchConfig,
        gyroscope: Gyroscope,
        amplifier: Amplifier,
        capture: Capture | None,
        clock: HostClock,
    ) -> None:
        self._config, self._clock, self._time = config, clock, clock.now_s
        self.gyroscope, self.amplifier, self.capture = gyroscope, amplifier, capture
        self.line: GyroLine | None = None
        self.link: CanLink | None = None
        self.notes: list[str] = []
        self.waiting: list[GyroSample] = []
        self.link_fault: DeviceFault | None = None
        self._settle_due_s = 0.0

    def contact(self) -> None:
        """Reach both and let their clocks settle. Raises one error that lists everything that is wrong."""
        begin_s = self._time()
        faults = [fault for fault in (self._open_gyro(), self._open_drive()) if fault is not None]
        if self.line is not None:
            while self._time() - begin_s < self._config.settle_s:
                self._clock.pause(CONTACT_TIME_S)
                self.gather()
                self._settle_drive(faults)
            self.line.note_noise()
            faults += [DeviceFault(text) for text in self.line.problems(self._time() - begin_s)]
        if faults:
            raise _together(faults)

    def _open_gyro(self) -> RigError | None:
        port = self._config.gyroscope.port
        if port is None:
            return ConfigError(
                "bench.gyroscope.port is empty: name its serial port (`rig devices` lists them) or run with --emulate"
            )
        try:
            serial = listening(open_port(port, self.gyroscope.baud), self._clock)
            self.line = GyroLine(self.gyroscope, serial, self.capture, self._time)
            self.line.request_identification()
        except Aborted:
            raise
        except RigError as fault:
            return fault
        return None

    def _open_drive(self) -> RigError | None:
        try:
            self.link = CanLink(open_bus(self._config.amplifier.can, self._clock), self._time, self._clock.pause)
            self.link.idle = self.gather
            self.link.on_sent = self.amplifier.note_sent
            self.link.record = self.capture.can if self.capture is not None else None
            self.notes = self.amplifier.contact(self.link)
        except Aborted:
            raise
        except RigError as fault:
            return fault
        return None

    def _settle_drive(self, faults: list[RigError]) -> None:
        if self.link is None or faults or self._time() < self._settle_due_s:
            return
        self._settle_due_s = self._time() + CONTACT_TIME_S
        try:
            self.amplifier.settle(self.link)
            self.link.poll()
        except Aborted:
            raise
        except RigError as fault:
            faults.append(fault)

    def gather(self) -> None:
        """Decode what has arrived, so that no buffer overflows; samples wait for the next exchange.

        A line that fails keeps its fault, and whoever asks it next is told.
        """
        if self.line is None or self.line.fault is not None:
            return
        with contextlib.suppress(DeviceFault):
            self.waiting += self.line.collect()
        if len(self.waiting) > MAX_WAITING_SAMPLES:
            del self.waiting[:-NEWEST_SAMPLES_KEPT]

    def listen(self, timeout_s: float) -> bool:
        """Wait for a bus that has no ear of its own, and stamp its frames as they arrive; False if none came."""
        link = self.link
        descriptor = -1 if link is None or self.link_fault is not None else link.fileno()
        if link is None or descriptor < 0 or not select.select((descriptor,), (), (), timeout_s)[0]:
            return False
        try:
            link.poll()
        except DeviceFault as fault:
            self.link_fault = fault
        return True

    def close(self) -> None:
        """Let go of both ports; safe twice."""
        for device in (self.link, self.line):
            if device is not None:
                device.close()
        self.link = None


def _together(faults: list[RigError]) -> RigError:
    """One error that lists all; a usage error only where nothing else is wrong."""
    if len(faults) == 1:
        return faults[0]
    text = "\n".join(f"  {fault}" for fault in faults)
    kind = ConfigError if all(isinstance(fault, ConfigError) for fault in faults) else DeviceFault
    return kind(f"{len(faults)} faults on the bench:\n{text}")
