"""Byte streams that half of the time are right: an input is a list of pieces, each raw or with a checksum made here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

Sealer = Callable[[bytes], bytes]


class Pieces(NamedTuple):
    """The bytes to feed, and where to cut them."""

    stream: bytes
    cuts: tuple[int, ...]


def pieces(data: bytes, sealers: tuple[Sealer, ...]) -> Pieces:
    """An input as a stream: control bytes say how long a piece is, who seals it, and where a read ends.

    A piece: one byte of kind (0 raw, k the k-th sealer; its upper bits cut the read here), one of length.
    """
    stream, cuts, at = bytearray(), [], 0
    while at + 2 <= len(data):
        kind, length = data[at], data[at + 1]
        body = data[at + 2 : at + 2 + length]
        at += 2 + length
        sealer = kind % (len(sealers) + 1)
        stream += body if sealer == 0 else sealers[sealer - 1](body)
        if kind >= 128:
            cuts.append(len(stream) - (kind & 7))
    return Pieces(bytes(stream), tuple(cuts))


def reads(fed: Pieces) -> Iterator[bytes]:
    """The stream in the chunks that the cuts make of it."""
    start = 0
    for cut in fed.cuts:
        if cut > start:
            yield fed.stream[start:cut]
            start = cut
    yield fed.stream[start:]
