"""A comparison on the terminal."""

from __future__ import annotations

import io
from collections.abc import Sequence

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from identify.report.comparison.section import Section
from identify.report.summary import RULES
from identify.wording import printable

TEXT_WIDTH = 120  # characters of a file: two numbers with their intervals and what lies between them


def comparison_text(sections: Sequence[Section], width: int = TEXT_WIDTH, colour: bool = False) -> str:
    """All sections as text of at most ``width`` columns; with ``colour`` headings in bold, for a terminal."""
    console = Console(
        file=io.StringIO(), width=width, force_terminal=colour, color_system="standard" if colour else None,
        highlight=False, markup=False, emoji=False, legacy_windows=False,
    )  # fmt: skip
    with console.capture() as captured:
        for number, section in enumerate(sections):
            if number:
                console.print()
            console.print(Text(section.title, style="bold"))
            if section.rows:
                console.print(_table(section))
            for note in section.notes:
                console.print(Padding(Text(printable(note)), (0, 0, 0, 2)))
    return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"


def _table(section: Section) -> Table:
    made = Table(box=RULES, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for number, head in enumerate(section.head):
        made.add_column(head, justify="left" if number in section.words else "right", overflow="fold")
    for row in section.rows:
        made.add_row(*[Text(printable(cell)) for cell in row])
    return made
