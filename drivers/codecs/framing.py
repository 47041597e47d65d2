"""Cutting a byte stream into packets, with an account of every byte that was not one.

A protocol supplies a *matcher*: given the buffer and a position it says how long the packet is that starts
there, or why none does. A head counts only when the checksum of the whole packet is right; the framer then
walks on byte by byte, so that it finds the next packet after any garbage.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

NEED_MORE = 0
NOT_A_HEAD = -1
BAD_CHECKSUM = -2
BAD_ENDING = -3
TOO_LONG = -4

REASONS = {
    NOT_A_HEAD: "no packet starts here",
    BAD_CHECKSUM: "checksum wrong",
    BAD_ENDING: "line ending wrong",
    TOO_LONG: "length out of range",
}

Matcher = Callable[[bytes, int], int]
"""(buffer, position) -> packet length, NEED_MORE, or a negative reason."""


@dataclass(frozen=True)
class Drop:
    """A stretch of bytes that no packet claimed: where in the stream, how many, and why."""

    offset: int
    count: int
    reason: str


class StreamFramer:
    """Feed it chunks of any size, get whole packets with their offset in the stream.

    ``dropped`` counts bytes by reason since the start, ``recent_drops`` keeps the last 64 stretches, so
    that a stream of garbage costs no memory.
    """

    def __init__(self, matcher: Matcher) -> None:
        self.matcher = matcher
        self.dropped: Counter[str] = Counter()
        self.drops = 0
        self.recent_drops: deque[Drop] = deque(maxlen=64)
        self._rest = b""
        self._offset = 0

    @property
    def dropped_bytes(self) -> int:
        """Bytes that belonged to no packet, since the start."""
        return self.dropped.total()

    @property
    def pending_bytes(self) -> int:
        """Bytes held back because a packet may still be arriving."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add bytes; return the packets that are now complete as (offset in the stream, packet)."""
        buffer = self._rest + data if self._rest else bytes(data)
        matcher = self.matcher
        packets: list[tuple[int, bytes]] = []
        position = 0
        junk_from = 0
        junk_reason = NOT_A_HEAD
        end = len(buffer)
        while position < end:
            length = matcher(buffer, position)
            if length > 0:
                if junk_from < position:
                    self._drop(junk_from, position, junk_reason)
                packets.append((self._offset + position, buffer[position : position + length]))
                position += length
                junk_from = position
                junk_reason = NOT_A_HEAD
            elif length == NEED_MORE:
                break
            else:
                junk_reason = min(junk_reason, length)
                position += 1
        if junk_from < position:
            self._drop(junk_from, position, junk_reason)
        self._rest = buffer[position:]
        self._offset += position
        return packets

    def flush(self) -> None:
        """Give up the bytes held back, as a drop: after a gap they cannot become a packet."""
        if self._rest:
            self._drop(0, len(self._rest), NOT_A_HEAD)
            self._offset += len(self._rest)
            self._rest = b""

    def _drop(self, start: int, stop: int, reason: int) -> None:
        text = REASONS[reason]
        self.dropped[text] += stop - start
        self.drops += 1
        self.recent_drops.append(Drop(self._offset + start, stop - start, text))
