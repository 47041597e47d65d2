"""What --help says of flags, in every command."""

from __future__ import annotations

import re

import pytest
import typer
from typer.testing import CliRunner

from commands.identify_run.app import app as identify_run
from commands.rig.app import app as rig
from commands.terminal.options import new_app

SUBCOMMANDS = tuple(c.name or c.callback.__name__ for c in rig.registered_commands if c.callback)
WIDE = {"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"}


def help_of(app: typer.Typer, *words: str) -> str:
    done = CliRunner().invoke(app, [*words, "--help"], env=WIDE)
    assert done.exit_code == 0, done.output
    return done.stdout


def between(text: str, option: str) -> str:
    """What stands between an option and its explanation, which begins with a capital or what it is a form of."""
    (line,) = [line for line in text.splitlines() if re.search(rf"{option}\b", line)]
    found = re.search(rf"{option}\s+(?:-\w\s+)?(.*?)\s*(?:[A-Z][a-z]|$)", line)
    assert found is not None
    return found.group(1)


@pytest.mark.parametrize("words", [(), *[(name,) for name in SUBCOMMANDS]], ids=lambda words: " ".join(words) or "rig")
def test_no_flag_asks_for_a_value(words: tuple[str, ...]) -> None:
    text = help_of(rig, *words)
    assert "<bool>" not in text
    assert between(text, "--help") == ""


def test_the_flags_of_identify_run_stand_alone_and_other_options_with_their_value() -> None:
    text = help_of(identify_run)
    assert "<bool>" not in text
    flags = ("--dry-run", "--emulate", "--yes", "--quiet", "--version", "--show-completion", "--help")
    assert [between(text, flag) for flag in flags] == [""] * len(flags)
    assert between(text, "--out") == "DIR"
    assert between(text, "--set") == "A.B.C=VALUE"
    assert between(text, "--seed").startswith("N ")


def test_a_flag_still_is_one() -> None:
    app = new_app("")
    seen: list[tuple[bool, str]] = []

    @app.command()
    def main(loud: bool = typer.Option(False, "--loud", help="Say it."), name: str = "x") -> None:
        seen.append((loud, name))

    assert CliRunner().invoke(app, ["--loud", "--name", "y"]).exit_code == 0
    assert CliRunner().invoke(app, []).exit_code == 0
    assert seen == [(True, "y"), (False, "x")]
    assert CliRunner().invoke(app, ["--loud=yes"]).exit_code == 2
