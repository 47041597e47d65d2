"""What holds for every protocol that is framed: nothing accepted unsound, no byte unaccounted for, memory bounded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from benchmarks.fuzz.streams import Pieces, reads
from drivers.codecs.framing import Matcher, StreamFramer
from drivers.gyroscopes import make_gyroscope
from rig.config.bench import GyroscopeConfig

Sound = Callable[[bytes], bool]
MOST_DROPS_KEPT = 64
LINE_BYTES_S = 92_160.0  # at 921600 baud
LONGEST_JUMP = 20_002  # samples that a driver marks as lost before it takes a gap for a new start


def check_framing(matcher: Matcher, fed: Pieces, sound: Sound, longest: int) -> list[bytes]:
    """The packets of the stream. Raises AssertionError where the framer breaks a promise.

    Parameters
    ----------
    sound
        Whether a packet has the right checksum, by a computation of the fuzz run's own.
    longest
        No packet of the protocol is longer; no more may be held back.
    """
    at_once = StreamFramer(matcher)
    packets = at_once.feed(fed.stream)
    in_reads = StreamFramer(matcher)
    found = [packet for chunk in reads(fed) for packet in in_reads.feed(chunk)]
    assert found == packets, "the packets depend on how the stream is cut into reads"
    for framer in (at_once, in_reads):
        accounted = sum(len(packet) for _, packet in packets) + framer.dropped_bytes + framer.pending_bytes
        assert accounted == len(fed.stream), "a byte is unaccounted for"
        assert framer.pending_bytes < longest, f"{framer.pending_bytes} bytes held back"
        assert len(framer.recent_drops) <= MOST_DROPS_KEPT
    for offset, packet in packets:
        assert fed.stream[offset : offset + len(packet)] == packet
        assert sound(packet), f"accepted with a wrong checksum: {packet.hex()}"
    return [packet for _, packet in packets]


def check_driver(config: GyroscopeConfig, chunks: Iterable[bytes], packets: int) -> None:
    """A gyroscope's driver on the same stream: no exception, valid samples finite and no more than sound packets."""
    driver = make_gyroscope(config)
    now_s, valid = 100.0, 0
    for chunk in chunks:
        now_s += len(chunk) / LINE_BYTES_S
        samples = driver.feed(chunk, now_s)
        assert len(samples) <= LONGEST_JUMP * max(1, packets), "samples out of nothing"
        for sample in samples:
            assert math.isfinite(sample.time_s), "a time that is no number"
            if sample.valid:
                valid += 1
                assert abs(sample.rate_rad_s) <= driver.full_scale_rad_s, "valid beyond the full scale"
    assert valid <= packets, "more valid samples than sound packets"
