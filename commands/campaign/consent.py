"""The question before real torque is applied."""

from __future__ import annotations

from collections.abc import Callable

from rig.errors import UsageError
from rig.interface import Statement, Torque

QUESTION = "REAL torque will be applied. Is everybody clear of the machine? Type yes to start: "


Consent = Callable[[Statement, bool, bool, Callable[[str], str]], None]


def consent_of(mode: str, question: str, not_confirmed: str) -> Consent:
    """The question before a further part of a campaign: --yes answers it only where the file says auto.

    ``question`` is asked where torque is not real, ``not_confirmed`` said where the answer is not yes.
    """
    if mode == "auto":
        return ask_consent

    def ask_each_time(statement: Statement, yes: bool, is_terminal: bool, ask: Callable[[str], str]) -> None:
        if statement.torque is Torque.REAL:
            ask_consent(statement, False, is_terminal, ask)
            return
        try:
            answer = ask(question)
        except EOFError:
            answer = ""
        if answer.strip().lower() not in ("yes", "y"):
            raise UsageError(not_confirmed)

    return ask_each_time


def ask_consent(statement: Statement, yes: bool, is_terminal: bool, ask: Callable[[str], str]) -> None:
    """Return where torque may be applied.

    Parameters
    ----------
    yes
        Whether --yes was given.
    is_terminal
        Whether somebody can answer.
    ask
        Puts the question and returns the answer; EOFError where none comes.

    Raises
    ------
    UsageError
        Where it may not; nothing was moved.
    """
    if statement.torque is not Torque.REAL or yes:
        return
    if not is_terminal:
        raise UsageError(
            "this campaign applies REAL torque and must be confirmed, but there is no terminal to ask on. Add --yes "
            "if the machine is clear, or try --dry-run or --emulate first. Nothing was moved."
        )
    try:
        answer = ask(QUESTION)
    except EOFError:
        answer = ""
    if answer.strip().lower() not in ("yes", "y"):
        raise UsageError("not started: the question was not answered with yes. Nothing was moved.")
