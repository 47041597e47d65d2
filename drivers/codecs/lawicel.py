"""Lawicel (slcan) protocol of serial CAN adapters.

    t123 2 AABB CR   standard frame        T 8 hex digits ... extended        r, R  the same as remote frames
    z CR / Z CR      "sent" (answer to t, r / T, R)    CR  done    BEL  refused    F.. V.... N....  answers
    S0..S8 bit rate · O open · C close · L listen only · Z1 time stamps: four more hex digits, ms modulo 60000

One adapter line is one frame, so a whole read is cut and decoded in one go.
"""

from __future__ import annotations

from binascii import hexlify, unhexlify
from dataclasses import dataclass
from typing import NamedTuple

ANSWER_OK, ANSWER_ERROR = b"\r", b"\a"
TIMESTAMP_MODULO_MS = 60_000

BIT_RATE_CODES = {
    10_000: "S0", 20_000: "S1", 50_000: "S2", 100_000: "S3", 125_000: "S4",
    250_000: "S5", 500_000: "S6", 800_000: "S7", 1_000_000: "S8",
}  # fmt: skip

FLAG_BITS = {
    0: "receive queue full",
    1: "transmit queue full",
    2: "error warning",
    3: "data overrun",
    5: "error passive",
    6: "arbitration lost",
    7: "bus error",
}
"""Bits of the answer to F (Lawicel CANUSB manual)."""

_MAX_FRAME_CHARACTERS = 40
_ID_DIGITS = {0x74: 3, 0x72: 3, 0x54: 8, 0x52: 8}  # t r T R
_REMOTE_HEADS = frozenset((0x72, 0x52))
_EXTENDED_HEADS = frozenset((0x54, 0x52))
_HEX = frozenset(b"0123456789abcdefABCDEF")
_FD_HEADS = frozenset(b"dDbB")
_FD_LENGTH_OF_CODE = {9: 12, 10: 16, 11: 20, 12: 24, 13: 32, 14: 48, 15: 64}


class CanFrame(NamedTuple):
    """One frame; ``timestamp_ms`` is the adapter's own clock, or -1 without Z1."""

    identifier: int
    data: bytes
    extended: bool = False
    remote: bool = False
    length: int = 0  # of a remote frame, which has no data
    timestamp_ms: int = -1
    fd: bool = False


@dataclass(frozen=True)
class Answer:
    """Anything an adapter says that is not a frame: kind "ok", "error", "sent", or a letter with its text."""

    kind: str
    text: str = ""


class LawicelDecoder:
    """Bytes of an adapter to frames and answers; resynchronises at the next line end.

    ``dropped`` lists (bytes, reason) of the last lines that were none, ``dropped_lines`` counts them.
    """

    def __init__(self) -> None:
        self.dropped_lines = 0
        self.dropped: list[tuple[bytes, str]] = []
        self._rest = b""

    def feed(self, data: bytes) -> list[CanFrame | Answer]:
        """Add bytes; return what is complete, in order."""
        buffer = self._rest + data
        if ANSWER_ERROR in buffer:
            # BEL ends an answer as CR does; after this every line stands alone.
            buffer = buffer.replace(ANSWER_ERROR, b"\a\r")
        *lines, self._rest = buffer.split(b"\r")
        out: list[CanFrame | Answer] = []
        for line in lines:
            item = decode_line(line)
            if isinstance(item, str):
                self._drop(line, item)
            else:
                out.append(item)
        if len(self._rest) > _MAX_FRAME_CHARACTERS * 4:
            self._drop(self._rest, "no line end")
            self._rest = b""
        return out

    def _drop(self, line: bytes, reason: str) -> None:
        self.dropped_lines += 1
        self.dropped = [*self.dropped[-15:], (line[:64], reason)]


def decode_line(line: bytes) -> CanFrame | Answer | str:
    """One line without its CR: a frame, an answer, or the reason why it is neither."""
    if not line:
        return Answer("ok")
    head = line[0]
    digits = _ID_DIGITS.get(head)
    if digits is not None:
        return _decode_frame(line, head, digits)
    return _decode_fd(line, head) if head in _FD_HEADS else _decode_answer(line, head)


def _decode_answer(line: bytes, head: int) -> Answer | str:
    if line.endswith(ANSWER_ERROR):
        return Answer("error", line[:-1].decode("ascii", errors="replace"))
    if line in (b"z", b"Z"):
        return Answer("sent")
    text = line[1:]
    if head == 0x46 and not _HEX.issuperset(text):
        return "flags that are no hexadecimal number"
    if head in b"FVNvWQa" and line.isalnum():
        return Answer(chr(head), text.decode("ascii"))
    return "neither frame nor answer"


def _decode_frame(line: bytes, head: int, digits: int) -> CanFrame | str:
    try:
        # Not int(..., 16), which also takes blanks, signs and underscores.
        identifier = int.from_bytes(unhexlify(line[1 : 1 + digits].rjust(8, b"0")))
        length = line[1 + digits] - 48
        if not 0 <= length <= 8:
            return "length above 8"
        start = 2 + digits
        remote = head in _REMOTE_HEADS
        stop = start if remote else start + 2 * length
        data = unhexlify(line[start:stop])
        stamp = line[stop:]
        timestamp = int.from_bytes(unhexlify(stamp)) if len(stamp) == 4 else -1
    except (ValueError, IndexError):
        return "not a frame"
    if (stamp and len(stamp) != 4) or (not remote and len(data) != length):
        return "frame cut or run together"
    if identifier > (0x1FFFFFFF if digits == 8 else 0x7FF):
        return "identifier out of range"
    return CanFrame(identifier, data, head in _EXTENDED_HEADS, remote, length, timestamp)


def _decode_fd(line: bytes, head: int) -> CanFrame | str:
    digits = 8 if head in b"DB" else 3
    try:
        code = int.from_bytes(unhexlify(line[1 + digits : 2 + digits].rjust(2, b"0")))
        length = _FD_LENGTH_OF_CODE.get(code, code)
        data = unhexlify(line[2 + digits :])
        identifier = int.from_bytes(unhexlify(line[1 : 1 + digits].rjust(8, b"0")))
    except ValueError:
        return "not a frame"
    if len(line) < 2 + digits or len(data) != length:
        return "frame cut or run together"
    if identifier > (0x1FFFFFFF if digits == 8 else 0x7FF):
        return "identifier out of range"
    return CanFrame(identifier, data, digits == 8, False, length, -1, True)


def encode_frame(frame: CanFrame) -> bytes:
    """The line for a classic frame, CR included; with a time stamp where the frame carries one."""
    length = frame.length if frame.remote else len(frame.data)
    if frame.extended:
        head = b"%c%08X%d" % (0x52 if frame.remote else 0x54, frame.identifier, length)
    else:
        head = b"%c%03X%d" % (0x72 if frame.remote else 0x74, frame.identifier, length)
    body = b"" if frame.remote else hexlify(frame.data).upper()
    stamp = b"%04X" % frame.timestamp_ms if frame.timestamp_ms >= 0 else b""
    return head + body + stamp + b"\r"


def flags_in_words(text: str) -> str:
    """The answer to F as words; "" when all is well."""
    flags = int(text or "0", 16)
    return ", ".join(words for bit, words in FLAG_BITS.items() if flags >> bit & 1)
