"""What is said while campaigns are identified."""

from __future__ import annotations

import io

import pytest

from commands.identify_batch.progress import Progress, duration
from commands.identify_batch.row import FAILED, IDENTIFIED, Row
from commands.terminal.display import Terminal


def row(path: str, status: str = IDENTIFIED, reason: str = "") -> Row:
    return {"path": path, "status": status, "reason": reason, "seconds": 2.5}


def said(quiet: bool, *rows: Row) -> str:
    stream, clock = io.StringIO(), iter([0.0, 10.0, 20.0, 30.0])
    terminal = Terminal(stream, quiet)
    with terminal.writing():
        progress = Progress(terminal, total=6, done=2, failed=1, now=lambda: next(clock))
        for one in rows:
            progress.finished(one)
    return stream.getvalue()


def test_a_line_a_campaign_says_what_is_done_and_what_the_rest_will_take() -> None:
    lines = said(False, row("a"), row("b")).splitlines()
    assert lines == ["a, 2.5 s: 3/6 done, 1 failed, about 30 s left", "b, 2.5 s: 4/6 done, 1 failed, about 20 s left"]


def test_a_failed_campaign_is_said_even_if_quiet_and_cannot_steer_the_terminal() -> None:
    assert said(True, row("a\x1b[2J", FAILED, "damaged\nfile"), row("b")) == "failed: a?[2J: damaged file\n"


@pytest.mark.parametrize(("seconds", "words"), [(9.4, "9 s"), (119, "119 s"), (600, "10 min"), (12000, "3 h 20 min")])
def test_times_are_said_in_the_unit_that_suits(seconds: float, words: str) -> None:
    assert duration(seconds) == words
