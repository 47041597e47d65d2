"""A gyroscope on its port: bytes read and stamped, captured, decoded; and what came of the first contact."""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from drivers.capture.wire_capture import Capture
from drivers.gyroscopes.base import Gyroscope, line_too_slow
from drivers.transport.listening import arrivals
from drivers.transport.ports import BytePort
from rig.errors import DeviceFault
from rig.interface import GyroSample

RAW_KEPT = 4096  # bytes, for the message where none of them is a packet
MIN_SHARE_RECEIVED = 0.5  # of the samples expected at first contact; fewer are another sample rate
RATE_TOLERANCE = 0.05  # of what the file says; crystals are better by far, a stall of this computer looks worse
PACE_S = 0.25  # s, a block of the sample rate
PACES_KEPT = 240  # blocks: a minute
MIN_FOR_NOISE = 100  # samples


@dataclass(frozen=True)
class GyroReport:
    """What a gyroscope did so far, for `rig check` and the report."""

    label: str
    received: int
    lost: int
    invalid: int
    dropped_bytes: int
    rate_hz: float
    noise_deg_s: float
    drift_ppm: float
    said: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.label}: {self.rate_hz:.1f} samples/s, noise {self.noise_deg_s:.3g} deg/s, clock "
            f"{self.drift_ppm:+.1f} ppm, {self.received} received, {self.lost} lost, {self.invalid} invalid, "
            f"{self.dropped_bytes} stray bytes"
        )


class GyroLine:
    """Joins a driver and a port.

    Parameters
    ----------
    gyroscope, port
        The protocol, and where its bytes come from.
    capture
        Where the bytes are kept, or None.
    clock
        Host time in seconds.
    """

    def __init__(
        self,
        gyroscope: Gyroscope,
        port: BytePort,
        capture: Capture | None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.gyroscope = gyroscope
        self._port = port
        self._capture = capture
        self._clock = clock
        self._chunks: list[tuple[float, bytes]] = []
        self._raw = bytearray()
        self._first_s: float | None = None
        self._last_s = 0.0
        self.fault: DeviceFault | None = None
        self._noise_deg_s = 0.0
        self._paces: deque[tuple[float, int]] = deque(maxlen=PACES_KEPT)  # (read at, samples until then)

    def note_noise(self) -> None:
        """Take the scatter of the last two seconds as the noise: call it while nothing moves."""
        rates = list(self.gyroscope.counts.recent_rates)
        self._noise_deg_s = math.degrees(statistics.stdev(rates)) if len(rates) > 2 else 0.0

    def request_identification(self) -> None:
        """Discard what lay in the buffers of the system, and ask the device to introduce itself."""
        self._port.read()
        request = self.gyroscope.identification_request()
        if request:
            self._port.write(request)
            if self._capture is not None:
                self._capture.gyro_sent(self._clock(), request)

    def _take(self) -> None:
        for at_s, data in arrivals(self._port, self._clock):
            self._chunks.append((at_s, data))
            if self._capture is not None:
                self._capture.gyro_read(at_s, data)

    def collect(self) -> list[GyroSample]:
        """Samples since the last call. Raises DeviceFault once the port has vanished."""
        if self.fault is None:
            try:
                self._take()
            except DeviceFault as fault:
                self.fault = fault
        if self.fault is not None:
            raise self.fault
        chunks, self._chunks = self._chunks, []
        samples: list[GyroSample] = []
        for read_at_s, data in chunks:
            samples += self.feed(data, read_at_s)
        return samples

    def feed(self, data: bytes, read_at_s: float) -> list[GyroSample]:
        """Decode bytes that were read at this time."""
        if self._first_s is None:
            self._first_s = read_at_s
        self._last_s = read_at_s
        if len(self._raw) < RAW_KEPT:
            self._raw += data
        samples = self.gyroscope.feed(data, read_at_s)
        if not self._paces or read_at_s >= self._paces[-1][0] + PACE_S:
            self._paces.append((read_at_s, self.gyroscope.counts.received))
        return samples

    def _other_rate(self) -> str:
        """What is wrong with the number of samples a second; empty where nothing is.

        A stall of this computer, or of an emulated device, bends the mean and not the median over quarters of a
        second; what is lost all the time bends both.
        """
        if len(self._paces) < 3:
            return ""
        (first_s, first), (last_s, last) = self._paces[0], self._paces[-1]
        mean_hz = (last - first) / (last_s - first_s)
        median_hz = statistics.median((m - n) / (t - s) for (s, n), (t, m) in itertools.pairwise(self._paces))
        wanted_hz, lost = self.gyroscope.sample_rate_hz, self.gyroscope.counts.lost
        shares = (mean_hz / wanted_hz - 1.0, median_hz / wanted_hz - 1.0)
        if min(map(abs, shares)) <= RATE_TOLERANCE:
            return ""
        where = f"; its counter shows that {lost} were lost in transmission" if lost else ""
        return (
            f"{mean_hz:.0f} samples/s instead of {wanted_hz:g}{where}: set bench.gyroscope.sample_rate_hz to the rate "
            "that the device is set to; if it is right already, the line or the adapter loses samples: check baud "
            "rate, buffers and cable"
        )

    def problems(self, listened_s: float) -> list[str]:
        """Why this gyroscope cannot be used, after listening to it for so long; empty when all is well."""
        if self.fault is not None:
            return [str(self.fault)]
        gyro, where = self.gyroscope, f"{self.gyroscope.label} on {self._port.name}"
        if not self._raw:
            return [f"{where}: no byte in {listened_s:.1f} s: check its supply, the cable (RS-422 pairs) and the port"]
        counts = gyro.counts
        if not counts.received:
            return [f"{where}: {gyro.explain_silence(bytes(self._raw))}"]
        found = [f"{where}: {objection}" for objection in gyro.objections()]
        if counts.received < MIN_SHARE_RECEIVED * gyro.sample_rate_hz * listened_s:
            found.append(
                f"{where}: {counts.received / listened_s:.0f} samples/s instead of {gyro.sample_rate_hz:g}: set "
                "bench.gyroscope.sample_rate_hz to what the device sends"
            )
        elif other_rate := self._other_rate():
            found.append(f"{where}: {other_rate}")
        if too_slow := line_too_slow(gyro.packet_bytes, gyro.sample_rate_hz, gyro.baud):
            found.append(
                f"{where}: {too_slow}: make the device send shorter packets, fewer packets, or use a higher baud rate"
            )
        rates = counts.recent_rates
        if not rates:
            found.append(f"{where}: no valid sample ({counts.last_reason or 'no reason given'})")
        elif len(rates) >= MIN_FOR_NOISE and min(rates) == max(rates):
            found.append(
                f"{where}: all of {len(rates)} samples read exactly {math.degrees(rates[0]):.6g} deg/s: a working "
                f"sensor shows noise. Check that the sensor measures axis {gyro.config.axis} (bench.gyroscope.axis), "
                "or restart it."
            )
        return found

    def report(self) -> GyroReport:
        """How it has been doing."""
        gyro, counts = self.gyroscope, self.gyroscope.counts
        span_s = self._last_s - (self._first_s or 0.0)
        return GyroReport(
            label=gyro.label,
            received=counts.received,
            lost=counts.lost,
            invalid=counts.invalid,
            dropped_bytes=gyro.framer.dropped_bytes,
            rate_hz=counts.received / span_s if span_s > 0 else 0.0,
            noise_deg_s=self._noise_deg_s,
            drift_ppm=gyro.clock.drift_ppm,
            said=gyro.messages.describe(),
        )

    def close(self) -> None:
        """Let go of the port."""
        self._port.close()
