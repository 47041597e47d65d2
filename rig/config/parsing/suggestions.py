"""The sentence for a word that nobody knows, with the nearest one that is known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


def unknown(kind: str, word: str, allowed: Iterable[str]) -> str:
    """The sentence for a word that is not in the list: the nearest one and the whole list."""
    known = list(allowed)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    hint = f", did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind} {word[:60]!r}{hint} (known: {', '.join(known)})"


class KeyFaults(ValueError):
    """Several things wrong inside one value, each with the path of its key below that value."""

    def __init__(self, faults: Sequence[tuple[tuple[str | int, ...], str]]) -> None:
        super().__init__("; ".join(text for _, text in faults))
        self.faults = tuple(faults)
