"""A log of bounded length: the first and the last messages are kept, the others counted."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")
KEPT_AT_EACH_END = 50  # lines: what fits on a screen


class FirstAndLast(list[T]):
    """A list that only grows by ``append``, and then to no more than twice ``kept``; what is in the middle goes.

    Parameters
    ----------
    kept
        How many of the first and how many of the last stay.
    """

    def __init__(self, kept: int = KEPT_AT_EACH_END) -> None:
        super().__init__()
        self._kept = kept
        self.left_out = 0

    def append(self, item: T) -> None:
        """Take one more."""
        if len(self) == 2 * self._kept:
            del self[self._kept]
            self.left_out += 1
        super().append(item)

    def describe(self, as_text: Callable[[T], str] = str) -> tuple[str, ...]:
        """All that is there as text, with a line in the place of what is not."""
        texts = [as_text(item) for item in self]
        if self.left_out:
            texts.insert(self._kept, f"... {self.left_out} more ...")
        return tuple(texts)
