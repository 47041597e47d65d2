"""LabVIEW's measurement files that have a heading for every piece: where the pieces begin, and at what time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from rig.arrays import Array
from rig.recording.readers.text.timestamps import Stamps

BEGIN, END = "Channels", "***End_of_Header***"
TIME = "X_Value"


@dataclass
class Segments:
    """Pieces of a file, seen as its lines are read.

    Attributes
    ----------
    rows
        How many rows stand before each further piece.
    begins
        Date and time of every piece, the first one's besides, as the file has them.
    """

    rows: list[int] = field(default_factory=list)
    begins: list[str] = field(default_factory=list)

    def data_of(self, lines: Iterable[tuple[int, str]], header_line: int) -> Iterator[tuple[int, str]]:
        """The lines behind the header that are rows: without the headings of further pieces."""
        self.rows, self.begins = [], []
        is_heading, is_names, count = False, False, 0
        stamp = ["", ""]
        for number, text in lines:
            label, _, rest = text.partition("\t")
            if label in ("Date", "Time"):
                stamp[label == "Time"] = rest.split("\t")[0].strip()
            if number <= header_line:
                if number == header_line:
                    self.begins.append(" ".join(stamp))
                continue
            if label == BEGIN:
                is_heading = True
            elif is_names:
                is_names = False  # the names once more
            elif is_heading:
                if text.startswith(END):
                    is_heading, is_names = False, True
                    self.rows.append(count)
                    self.begins.append(" ".join(stamp))
            else:
                count += 1
                yield number, text

    def laid(self, time_s: Array) -> Array:
        """The times of all rows, (n,), those of a piece that begins anew moved by the dates of the pieces."""
        out = time_s.copy()
        stamps = Stamps()
        try:
            begins = [stamps.seconds(begin) for begin in self.begins]
        except ValueError:
            return out
        for i, row in enumerate(self.rows):
            end = self.rows[i + 1] if i + 1 < len(self.rows) else len(out)
            if 0 < row < len(out) and out[row] <= np.nanmax(out[:row]):
                out[row:end] += begins[i + 1] - begins[0]
        return out
