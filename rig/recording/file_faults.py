"""What is wrong with the files of a campaign: a fault that several of them share is told once."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

MAX_NAMED = 4  # further files with the same fault
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?|nan|inf")


@dataclass
class FileFaults:
    """Faults in the order found, those that differ in their numbers alone put together."""

    _first: dict[str, str] = field(default_factory=dict)
    _further: dict[str, list[str]] = field(default_factory=dict)

    def add(self, path: Path, text: str) -> None:
        """What is wrong with one file, which the text begins with."""
        kind = _NUMBER.sub("0", text.removeprefix(f"{path}: ")) if text.startswith(f"{path}: ") else text
        if kind not in self._first:
            self._first[kind] = text
        elif self._first[kind] != text and path.name not in self._further.get(kind, ()):
            self._further.setdefault(kind, []).append(path.name)

    def lines(self) -> list[str]:
        """One text a fault; the first file that has it is named first."""
        return [text + _also(self._further.get(kind, [])) for kind, text in self._first.items()]


def _also(names: list[str]) -> str:
    if not names:
        return ""
    more = len(names) - MAX_NAMED
    return f" (the same in {', '.join(names[:MAX_NAMED])}{f' and {more} more' if more > 0 else ''})"
