"""Shell completion: the script of each shell, and what it proposes. Each in a process of its own, as a shell asks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAMS = {"rig": "commands.rig", "identify-run": "commands.identify_run"}
MOST_S = 60.0


def asked(program: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """A program as a shell starts it to complete a line."""
    variable = f"_{program.replace('-', '_').upper()}_COMPLETE"
    return subprocess.run(
        [sys.executable, "-c", f"from {PROGRAMS[program]} import main; main()"], capture_output=True, text=True,
        check=False, timeout=MOST_S, stdin=subprocess.DEVNULL,
        env={**os.environ, **{variable if k == "ask" else k: v for k, v in variables.items()}},
    )  # fmt: skip


def proposed(program: str, line: str) -> list[str]:
    """What bash is offered at the end of a line."""
    done = asked(program, ask="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(line.split(" ")) - 1))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.split()


@pytest.mark.parametrize(("shell", "holds"), [
    ("bash", "complete -o default -F _rig_completion rig"), ("zsh", "#compdef rig"), ("fish", "complete --command rig"),
    ("powershell", "Register-ArgumentCompleter"),
])  # fmt: skip
def test_the_script_of_each_shell_is_printed(shell: str, holds: str) -> None:
    done = asked("rig", ask=f"source_{shell}")
    assert done.returncode == 0, done.stderr
    assert holds in done.stdout


def test_subcommands_are_proposed() -> None:
    assert sorted(proposed("rig", "rig re")) == ["recover", "report"]


@pytest.mark.parametrize(
    ("program", "line", "options"),
    [("identify-run", "identify-run --d", ["--dry-run"]), ("rig", "rig play --e", ["--emulate"])],
)
def test_options_are_proposed(program: str, line: str, options: list[str]) -> None:
    assert proposed(program, line) == options


@pytest.mark.skipif(sys.platform == "win32", reason="no bash")
def test_bash_takes_the_script_and_completes_with_it(tmp_path: Path) -> None:
    (tmp_path / "rig.sh").write_text(asked("rig", ask="source_bash").stdout, encoding="utf-8")
    (tmp_path / "rig").write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -c "from commands.rig import main; main()" "$@"\n', encoding="utf-8"
    )
    (tmp_path / "rig").chmod(0o755)
    script = (
        f'PATH="{tmp_path}:$PATH"; . "{tmp_path}/rig.sh"; COMP_WORDS=(rig sch); COMP_CWORD=1; '
        '_rig_completion rig; echo "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=False, timeout=MOST_S)
    assert done.stdout.strip() == "schema", done.stderr
