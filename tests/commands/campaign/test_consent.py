"""Real torque needs a yes that was typed after the question."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from typing import TextIO

import pytest

if sys.platform == "win32":
    pytest.skip("pseudo terminals are POSIX", allow_module_level=True)

import pty

from commands.campaign import playing
from commands.campaign.consent import QUESTION, ask_consent
from commands.terminal.display import discard_typed_ahead
from rig.errors import UsageError
from rig.interface import Statement, Torque

REAL = Statement(Torque.REAL, ("a drive",))


class Answering(io.StringIO):
    """Somebody who types ``answer`` once the question is there."""

    def __init__(self, keyboard: int, answer: str) -> None:
        super().__init__()
        self._keyboard, self._answer = keyboard, answer

    def write(self, text: str) -> int:
        if text == QUESTION:
            os.write(self._keyboard, self._answer.encode())
        return super().write(text)


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The keyboard of a terminal that is standard input."""
    keyboard, screen = pty.openpty()
    with os.fdopen(screen, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield keyboard
    os.close(keyboard)


def asked(monkeypatch: pytest.MonkeyPatch, keyboard: int, answer: str) -> str:
    """What stood on the screen, where the answer was a consent."""
    screen = Answering(keyboard, answer)
    monkeypatch.setattr(sys, "stderr", screen)
    ask_consent(REAL, False, sys.stdin.isatty(), playing._ask)
    return screen.getvalue()


def test_a_yes_typed_before_the_question_is_no_consent(terminal: int, monkeypatch: pytest.MonkeyPatch) -> None:
    os.write(terminal, b"yes\nyes\n")
    with pytest.raises(UsageError, match="not answered with yes"):
        asked(monkeypatch, terminal, "no\n")


def test_a_yes_typed_after_the_question_is(terminal: int, monkeypatch: pytest.MonkeyPatch) -> None:
    os.write(terminal, b"half a line")
    assert asked(monkeypatch, terminal, "yes\n").count(QUESTION) == 1


def test_what_is_no_terminal_keeps_what_it_has() -> None:
    stream: TextIO = io.StringIO("yes\n")
    discard_typed_ahead(stream)
    assert stream.read() == "yes\n"
