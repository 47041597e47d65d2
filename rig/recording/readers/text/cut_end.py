"""Whether the last line of a text file was cut while it was written: by its fields, or by how its last number ends."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

TAIL_BYTES = 1 << 16  # of the end that are looked at
MIN_LINES = 3  # before the last one, or nothing can be said of it
COMPARED = 200  # lines before the last one
FEW = 0.1  # of their last numbers have as few decimals
_NUMBER = re.compile(r"[-+]?\d*(?:[.,](\d*))?(?:[eEdD][-+]?(\d+))?$")


def cut_end(path: Path, encoding: str, fields: Callable[[str], list[str]], width: int) -> str:
    """What shows that the last line is cut, as the end of a sentence that names it; empty where nothing does.

    Parameters
    ----------
    fields
        Splits a line.
    width
        How many fields a line of the data has.
    """
    text = _tail(path, encoding)
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("#", "%", "//"))]
    rows = [fields(line) for line in lines[-COMPARED - 1 :]]
    if len(rows) <= MIN_LINES or any(len(row) < width for row in rows[-MIN_LINES - 1 : -1]):
        return ""
    last = rows[-1]
    if len(last) < width:
        return f"has {len(last)} of {width} fields"
    if text.endswith(("\n", "\r")):
        return ""
    at = width - 1
    before = [row[at] for row in rows[:-1] if len(row) > at]
    if not last[at] and sum(not field for field in before) < FEW * len(before):
        return "ends without a last number and without a line end"
    return f"ends in {last[at]!r}, shorter than those before, without a line end" if _shorter(last[at], before) else ""


def _tail(path: Path, encoding: str) -> str:
    """The last lines of a file, the first of them whole."""
    if path.name.lower().endswith(".gz"):
        begin, end = b"", b""
        with gzip.open(path) as packed:
            while block := packed.read(1 << 20):
                begin = begin or block[:2]
                end = (end + block)[-TAIL_BYTES:]
    else:
        with path.open("rb") as file:
            begin = file.read(2)
            size = file.seek(0, 2)
            file.seek(max(0, size - TAIL_BYTES - size % 2))  # a character of UTF-16 has two bytes
            end = file.read()
    if encoding == "utf-16":
        encoding = "utf-16-be" if begin == b"\xfe\xff" else "utf-16-le"
    return end.decode(encoding, "replace").partition("\n")[2]


def _shorter(last: str, before: Sequence[str]) -> bool:
    """Whether a last number has lost digits, by how many decimals and what exponents those before it have."""
    found = _NUMBER.match(last)
    others = [match for field in before if (match := _NUMBER.match(field)) is not None]
    if found is None:
        return last not in before and any(field.startswith(last) for field in before)
    if not others:
        return False
    if any(match[2] is not None for match in others):
        return found[2] is None or len(found[2]) < min(len(match[2] or "") for match in others)
    decimals = [len(match[1] or "") for match in others]
    if not any(decimals):
        return len(last) < min(len(match[0]) for match in others)
    return len(found[1] or "") < float(np.quantile(decimals, FEW))
