"""The opening says loudly what is about to happen, and real torque asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from commands.campaign.announcement import announcement
from commands.campaign.consent import ask_consent
from rig.config.root import Config
from rig.errors import UsageError
from rig.excitation import planned
from rig.interface import Statement, Torque

REAL = Statement(Torque.REAL, ("a drive", "a gyro"))
SIMULATED = Statement(Torque.SIMULATED, ("equations",))


def never(question: str) -> str:
    pytest.fail(f"asked: {question}")


def test_it_names_the_kind_of_torque_the_limits_every_set_the_time_and_the_folder() -> None:
    config = Config(name="a", backend="simulated")
    sets = [s.scaled(0.5) for s in planned(config.excitation.sets)]
    said = announcement(REAL, config, sets, Path("runs/x"))
    for words in ("Torque is REAL: a drive; a gyro", "travel 10 deg", "rate 400 deg/s", "torque 350 N m", "runs/x"):
        assert words in said
    assert "0.5 Hz: 10 s, up to 150.0 N m, reduced to 50.0 %" in said
    assert "99 s on the bench" in said


@pytest.mark.parametrize("statement", [SIMULATED, Statement(Torque.EMULATED, ())])
def test_torque_that_is_not_real_needs_no_consent(statement: Statement) -> None:
    questions: list[str] = []
    ask_consent(statement, yes=False, is_terminal=False, ask=lambda q: questions.append(q) or "")
    assert questions == []


def test_yes_on_the_command_line_is_consent() -> None:
    questions: list[str] = []
    ask_consent(REAL, yes=True, is_terminal=False, ask=lambda q: questions.append(q) or "")
    assert questions == []


def test_without_a_terminal_real_torque_is_refused() -> None:
    with pytest.raises(UsageError, match="--yes"):
        ask_consent(REAL, yes=False, is_terminal=False, ask=never)


@pytest.mark.parametrize("answer", ["yes", "YES ", "y"])
def test_the_answer_yes_starts(answer: str) -> None:
    asked: list[str] = []
    ask_consent(REAL, yes=False, is_terminal=True, ask=lambda question: asked.append(question) or answer)
    assert len(asked) == 1 and "REAL torque" in asked[0]


@pytest.mark.parametrize("answer", ["", "no", "yess", "ja"])
def test_any_other_answer_does_not(answer: str) -> None:
    with pytest.raises(UsageError, match="Nothing was moved"):
        ask_consent(REAL, yes=False, is_terminal=True, ask=lambda question: answer)


def test_a_terminal_that_closes_is_no_yes() -> None:
    def closed(question: str) -> str:
        raise EOFError

    with pytest.raises(UsageError):
        ask_consent(REAL, yes=False, is_terminal=True, ask=closed)
