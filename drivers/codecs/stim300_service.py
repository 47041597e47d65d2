"""STIM300 service mode (for people) and utility mode (for machines, with CRC-8).

Datasheet TS1524 rev. 31, sections 9 and 10. In utility mode the CRC covers everything before it, the
leading "$" or "#" and the last comma included.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.codecs.checksums import crc8_07

SERVICE_PROMPT = b"\r>"
EXIT_MARK = b"SYSTEM RETURNING TO"

SERVICE_COMMANDS = {
    "a": "single-shot measurement",
    "b": "bias trim offset",
    "c": "diagnostic",
    "d": "datagram format",
    "f": "low-pass filter frequency",
    "g": "gyro g-compensation",
    "h": "system configuration",
    "i": "information",
    "m": "sample rate",
    "r": "line termination",
    "s": "save",
    "t": "transmission parameters",
    "u": "output unit",
    "x": "exit",
    "z": "restore factory settings",
    "?": "help",
}

UTILITY_STATUS = {
    0: "OK",
    1: "invalid command",
    2: "wrong CRC",
    3: "unknown command",
    4: "wrong number of parameters",
    5: "invalid parameter",
    6: "maximum number of saves exceeded",
    7: "error during save",
    8: "requested change reduced to the limits of the bias trim",
}


def encode_service_command(command: str, *parameters: object) -> bytes:
    """``d 3,1`` and carriage return.

    Raises
    ------
    ValueError
        If the letter is not a service-mode command.
    """
    if command not in SERVICE_COMMANDS:
        raise ValueError(f"{command!r} is not a service-mode command; allowed: {' '.join(SERVICE_COMMANDS)}")
    text = ",".join(str(p) for p in parameters)
    if not text.isprintable():
        raise ValueError(f"service-mode parameters must be printable, got {text!r}")
    return f"{command} {text}\r".encode("ascii") if text else f"{command}\r".encode("ascii")


@dataclass(frozen=True)
class ServiceAnswer:
    """Lines of a service-mode answer, and its error ("E007 DATAGRAM WILL BE TOO LONG ..."), if any."""

    lines: tuple[str, ...]
    error: str = ""


def decode_service_answer(raw: bytes) -> ServiceAnswer | None:
    """The answer, or None while the prompt (or, after ``x``, the farewell line) has not arrived."""
    if not raw.endswith(SERVICE_PROMPT) and not re.search(re.escape(EXIT_MARK) + rb"[^\r]*\r", raw):
        return None
    text = raw.removesuffix(b">").decode("ascii", errors="replace")
    lines = tuple(line.strip() for line in text.splitlines() if line.strip())
    error = next((line for line in lines if re.match(r"E\d{3}\b", line)), "")
    return ServiceAnswer(lines, error)


@dataclass(frozen=True)
class UtilityMessage:
    """A command ("$") or an answer ("#") of utility mode; a command and the greeting have no status."""

    name: str
    parameters: tuple[str, ...]
    is_answer: bool
    crc: int
    status: int | None = None

    @property
    def status_in_words(self) -> str:
        return "" if self.status is None else UTILITY_STATUS.get(self.status, f"status {self.status}")


def encode_utility(name: str, *parameters: object, answer: bool = False) -> bytes:
    """``$isn,28`` and carriage return; for an answer pass its status as the first parameter."""
    body = ("#" if answer else "$") + ",".join([name, *(str(p) for p in parameters)]) + ","
    encoded = body.encode("ascii")
    return encoded + str(crc8_07(encoded)).encode("ascii") + b"\r"


def decode_utility(line: bytes) -> UtilityMessage:
    """One message, with or without its carriage return.

    Raises
    ------
    ValueError
        If it has not the form of a utility-mode message or its CRC is wrong.
    """
    line = line.removesuffix(b"\r")
    body, comma, crc_text = line.rpartition(b",")
    if body[:1] not in (b"$", b"#") or not re.fullmatch(rb"\d{1,3}", crc_text):
        raise ValueError(f"not a utility-mode message: {line[:40]!r}")
    expected = crc8_07(body + comma)
    if int(crc_text) != expected:
        raise ValueError(f"utility-mode message {line[:40]!r}: CRC {int(crc_text)}, computed {expected}")
    name, *fields = body[1:].decode("ascii", errors="replace").split(",")
    is_answer = body[:1] == b"#"
    status = int(fields.pop(0)) if is_answer and fields and fields[0].isdigit() else None
    return UtilityMessage(name, tuple(fields), is_answer, int(crc_text), status)
