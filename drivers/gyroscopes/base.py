"""What every gyroscope driver shares: counting, time at the source, lost and invalid samples.

A driver of a new device gives its packet matcher, says how a packet becomes a ``Reading``, and states
its rate, delay and noise; see docs/devices/new-gyroscope.md. It does no I/O: bytes with the time at which
they were read go in, samples come out, so that a capture replays to the same samples.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from typing import NamedTuple

from drivers.bounded_log import FirstAndLast
from drivers.codecs.framing import Matcher, StreamFramer
from drivers.settings import Settings
from drivers.timing.retiming import ClockRetiming
from drivers.timing.source_clock import SourceClock
from rig.config.bench import GyroscopeConfig
from rig.errors import ConfigError
from rig.interface import GyroSample, LowPass

AXES = "xyz"
BITS_PER_BYTE = 10  # start, eight data bits, stop
LONGEST_BURST_S = 0.03  # a kernel that was busy hands out what it kept back within this time
MESSAGES_KEPT = 5  # first and last messages of a device
MAX_LOST_MARKED = 20_000  # ten seconds at 2 kHz: more is a new start, not a gap


class Reading(NamedTuple):
    """One sample as the device sent it.

    ``number`` is the device's running number (modulo ``Gyroscope.count_modulus``), or None where it has
    none; ``latency_s`` the time from the sample to the first bit on the wire, where the device says so.
    """

    number: int | None
    rate_rad_s: float
    valid: bool
    latency_s: float = 0.0


class SampleCounts:
    """What came through so far, and why some of it is not used."""

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self.invalid = 0
        self.repeated = 0
        self.last_reason = ""
        self.latency_s = 0.0
        self.recent_rates: deque[float] = deque(maxlen=4000)


def line_too_slow(packet_bytes: int, sample_rate_hz: float, baud: int) -> str:
    """Why a line cannot carry packets of this length at this rate; empty where it can."""
    needed = BITS_PER_BYTE * packet_bytes * sample_rate_hz
    if needed <= baud:
        return ""
    return (
        f"bench.gyroscope.baud: {packet_bytes} bytes {sample_rate_hz:g} times a second need {needed:.0f} baud, the "
        f"line has {baud}"
    )


class Gyroscope(ABC):
    """A gyroscope's protocol.

    Parameters
    ----------
    config
        The `bench.gyroscope` section.
    matcher
        How its packets are found in the stream.
    sample_rate_hz, baud
        As the device is set.
    """

    label = "gyroscope"
    settings_model: type[Settings] | None = None  # of `bench.gyroscope.settings`; None: not stated
    default_baud = 921_600
    default_rate_hz = 1000.0
    count_modulus = 0
    """The device's counter wraps here; 0 where it does not, or there is none."""
    shortest_sample_bytes = 0
    """No packet with a sample is shorter: a line that cannot carry those is refused before it is opened."""
    answers_replace_samples = False
    """True where an answer of the device is sent in the place of a sample, which is then not lost."""

    def __init__(self, config: GyroscopeConfig, matcher: Matcher) -> None:
        self.config = config
        self.baud = config.baud or self.default_baud
        self.sample_rate_hz = config.sample_rate_hz or self.default_rate_hz
        too_slow = line_too_slow(self.shortest_sample_bytes, self.sample_rate_hz, self.baud)
        if too_slow:
            raise ConfigError(f"{too_slow}: choose a lower rate or a faster line")
        self.axis = AXES.index(config.axis)
        self.sign = -1.0 if config.invert else 1.0
        self.framer = StreamFramer(matcher)
        self.clock = SourceClock(1.0 / (self.sample_rate_hz * self.counts_per_sample))
        self.retiming = ClockRetiming(self.clock)
        self.counts = SampleCounts()
        self.messages: FirstAndLast[str] = FirstAndLast(MESSAGES_KEPT)
        self.packet_bytes = 0
        """Length of the last packet with a sample."""
        self._count: int | None = None
        self._newest: tuple[Reading, float] | None = None
        self._replaced = 0
        self._late_since_s = math.inf

    @property
    def counts_per_sample(self) -> int:
        """How far the device's counter moves between two datagrams."""
        return 1

    @property
    @abstractmethod
    def delay_s(self) -> float:
        """From the motion to the instant that the clock gives a sample: group delay of the filter."""

    def describe_delays(self) -> tuple[str, ...]:
        """What is taken off the time at which a sample was read, in words; the last as it was with the last sample."""
        on_wire_s = self.packet_bytes * BITS_PER_BYTE / self.baud
        steps = (
            ("gyro group delay", self.delay_s),
            ("gyro latency by its packets", self.counts.latency_s),
            ("gyro packet transmission", on_wire_s),
        )
        return tuple(f"{words} {1e3 * delay_s:.3g} ms" for words, delay_s in steps if delay_s > 0.0)

    @property
    def low_pass(self) -> LowPass | None:
        """Corner and group delay of the filter that rounds the rate, where the data sheet gives both."""
        return None

    @property
    def full_scale_rad_s(self) -> float:
        """Readings above this are invalid."""
        return math.inf

    @property
    def noise_rad_s(self) -> float | None:
        """One standard deviation of a sample, where the data sheet gives it."""
        return None

    @abstractmethod
    def decode(self, packet: bytes) -> Reading | None:
        """The sample in a packet, or None for a packet without one (put what it said into ``messages``)."""

    def identification_request(self) -> bytes:
        """What to send to make the device introduce itself; b"" for nothing."""
        return b""

    def objections(self) -> list[str]:
        """What the device said of itself that contradicts the configuration; empty when all fits."""
        return []

    def explain_silence(self, raw: bytes) -> str:
        """Why these bytes hold no packet, in words that lead to the cure."""
        return f"{len(raw)} bytes but no packet of a {self.label} at {self.baud} baud: check the baud rate"

    def feed(self, data: bytes, read_at_s: float) -> list[GyroSample]:
        """Samples that became complete with these bytes, lost ones included as invalid NaN.

        Parameters
        ----------
        read_at_s
            Host time at which the bytes were there.
        """
        readings: list[tuple[Reading, float]] = []
        packets = self.framer.feed(data)
        behind = self.framer.pending_bytes
        for _, packet in reversed(packets):
            try:
                reading = self.decode(packet)
            except ValueError as nonsense:  # whole on the wire, but it says what no data sheet knows
                self.counts.last_reason = str(nonsense)
                reading = None
            # What still arrived behind a packet in this read came after it, at the speed of the line.
            on_wire_s = (len(packet) + behind) * BITS_PER_BYTE / self.baud
            behind += len(packet)
            if reading is None:
                self._replaced += self.answers_replace_samples
            else:
                self.packet_bytes = len(packet)
                self.counts.latency_s = reading.latency_s
                readings.append((reading, read_at_s - on_wire_s - reading.latency_s))
        return self._stamp(readings[::-1])

    def _first_seen(self, readings: list[tuple[Reading, float]]) -> list[tuple[Reading, float]]:
        """Without what came twice, the same number and rate soon after: it would count as a turn of the counter.

        Half a turn of the counter later it is another sample that happens to look alike.
        """
        turn_s = self.count_modulus * self.clock.period_s if self.count_modulus else math.inf
        fresh = []
        for reading, at_s in readings:
            newest, self._newest = self._newest, (reading, at_s)
            before, before_s = newest if newest is not None else (None, -math.inf)
            if before is None or reading.number is None or reading[:3] != before[:3] or at_s - before_s > 0.5 * turn_s:
                fresh.append((reading, at_s))
            else:
                self.counts.repeated += 1
        return fresh

    def _stamp(self, every: list[tuple[Reading, float]]) -> list[GyroSample]:
        readings = self._first_seen(every)
        if not readings:
            return []
        counts = self._unwrap([reading.number for reading, _ in readings], readings[-1][1])
        samples: list[GyroSample] = []
        for count, (reading, taken_at_s) in zip(counts, readings, strict=True):
            self._mark_lost(count, samples)
            if reading.valid or not self.clock.started:  # a device that starts up misreports its latency
                self.clock.observe(count, taken_at_s)
                self.retiming.observe(count * self.clock.period_s, taken_at_s)
            samples.append(self._sample(count, reading))
            self._count = count
        return samples

    def _sample(self, count: int, reading: Reading) -> GyroSample:
        rate = self.sign * reading.rate_rad_s
        valid = reading.valid and abs(rate) <= self.full_scale_rad_s
        if reading.valid and not valid:
            self.counts.last_reason = (
                f"rate of {math.degrees(rate):.0f} deg/s beyond the full scale of "
                f"{math.degrees(self.full_scale_rad_s):.0f} deg/s"
            )
        self.counts.received += 1
        self.counts.invalid += not valid
        if valid:
            self.counts.recent_rates.append(rate)
        clock = self.clock
        time_s = clock.host_time_s(count) - self.delay_s
        self.retiming.record(time_s, count * clock.period_s, clock.fits)
        return GyroSample(time_s, rate, valid)

    def _mark_lost(self, count: int, samples: list[GyroSample]) -> None:
        if self._count is None:
            return
        step = self.counts_per_sample
        missing = (count - self._count) // step - 1
        if not 0 < missing <= MAX_LOST_MARKED:
            return
        excused = min(missing, self._replaced)
        self._replaced -= excused
        self.counts.lost += missing - excused
        for k in range(missing):
            at = self._count + (k + 1) * step
            samples.append(GyroSample(self.clock.host_time_s(at) - self.delay_s, math.nan, False))

    def _unwrap(self, counts: list[int | None], last_taken_at_s: float) -> list[int]:
        """Counters of one read as running numbers.

        A counter that wraps after 128 ms cannot tell a gap from none; how late its datagrams seem to be
        shows how many turns are missing. What only was held up somewhere catches up within ``LONGEST_BURST_S``.
        """
        step, modulus = self.counts_per_sample, self.count_modulus
        previous, unwrapped, gap_at = self._count, [], 0
        for k, raw in enumerate(counts):
            if previous is None:
                value = raw or 0
            elif raw is None:
                value = previous + step
            elif modulus:
                value = previous + ((raw - previous) % modulus or modulus)
            else:
                value = raw
            if previous is not None and value - previous != step and not gap_at:
                gap_at = k
            unwrapped.append(value)
            previous = value
        if self._count is None or not modulus or not self.clock.settled:
            return unwrapped
        late_s = last_taken_at_s - self.clock.host_time_s(unwrapped[-1])
        turns = max(round(late_s / (modulus * self.clock.period_s)), 0)
        if not turns:
            self._late_since_s = math.inf
            return unwrapped
        self._late_since_s = min(self._late_since_s, last_taken_at_s)
        if last_taken_at_s - self._late_since_s < LONGEST_BURST_S:
            return unwrapped
        self._late_since_s = math.inf
        return [value + turns * modulus if k >= gap_at else value for k, value in enumerate(unwrapped)]

    def restart(self) -> None:
        """Forget the count and the clock: the device was switched off and on, or its port reopened."""
        self.framer.flush()
        self.clock = SourceClock(self.clock.period_s)
        self.retiming.reset(self.clock)
        self._count = None
