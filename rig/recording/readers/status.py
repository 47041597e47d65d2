"""A column of words beside the numbers, of which nearly all are the same: what it says of the other rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rig.recording.readers.text.words import NO_READING

MOST_WORDS = 12  # different ones: more are a comment or a name
USUAL = 0.5  # of the rows have the usual word
MAX_WORD_CHARACTERS = 40  # characters of a word that is told


@dataclass
class Status:
    """The words of one column, counted as they come."""

    name: str
    counts: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)

    def add(self, word: str, place: str) -> None:
        """One row; ``place`` says where it stands."""
        if len(self.counts) <= MOST_WORDS:
            self.counts[word] += 1
            self.first.setdefault(word, place)

    def told(self) -> str:
        """What somebody has to know of it, in words; empty where it says nothing, or every row the same."""
        if not 1 < len(self.counts) <= MOST_WORDS:
            return ""
        (usual, count), *others = self.counts.most_common()
        is_bad = any(word.lower() in NO_READING for word, _ in others)
        if not usual or (count < USUAL * sum(self.counts.values()) and not is_bad):
            return ""
        listed = ", ".join(f"{word[:MAX_WORD_CHARACTERS]!r} in {n} (first in {self.first[word]})" for word, n in others)
        return (
            f"column {self.name!r} is {usual[:MAX_WORD_CHARACTERS]!r} in {count} rows and {listed}; "
            "they are read alike: if the others are no readings, empty their numbers, or add a column valid that "
            "is 0 there"
        )


def told_of(columns: Mapping[int, str], rows: Iterable[tuple[str, list[str]]]) -> list[str]:
    """What the columns (position -> name) say; ``rows`` are the place and the fields of each."""
    found = {position: Status(name) for position, name in columns.items()}
    for place, fields in rows:
        for position, status in found.items():
            if position < len(fields):
                status.add(fields[position], place)
    return [text for status in found.values() if (text := status.told())]
