"""A table of a comparison with what there is to say about it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Section:
    """Plain text, for a terminal and for a page alike.

    Attributes
    ----------
    rows
        Each as long as ``head``; the first cell names the row.
    words
        Columns that hold text and not numbers.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    words: tuple[int, ...] = (0,)
