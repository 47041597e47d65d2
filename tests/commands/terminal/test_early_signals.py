"""A signal in the first moments of a command ends it quietly, and one in its last does not change how it ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

if sys.platform == "win32":
    pytest.skip("a process cannot signal itself gently there", allow_module_level=True)

from commands.terminal import early_signals
from commands.terminal.exit_codes import run_to_exit_code

SLOW_IMPORT = """
import sys, time
class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            print("importing", flush=True)
            time.sleep(30)
sys.meta_path.insert(0, Slow())
sys.argv = ["command", "check", "rig.yaml"]
from {module} import main
main()
"""
FINISHED = """
import time
from commands.terminal.early_signals import end_on_signals
from commands.terminal.exit_codes import run_to_exit_code
end_on_signals()
run_to_exit_code(lambda: 1)
print("concluded", flush=True)
time.sleep(30)
"""


def struck(program: str, number: int) -> tuple[int, str]:
    """Exit code and stderr of a program that is sent a signal once it has said something."""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(number)
        _, said = process.communicate(timeout=20)
        return process.returncode, said


@pytest.mark.parametrize("module", ["commands.identify_run", "commands.rig"])
@pytest.mark.parametrize(("name", "told"), [("SIGINT", "Ctrl-C"), ("SIGTERM", "SIGTERM")])
def test_while_the_program_is_still_importing_a_signal_ends_it_in_130_without_a_traceback(
    module: str, name: str, told: str
) -> None:
    code, said = struck(SLOW_IMPORT.replace("{module}", module), getattr(signal, name))
    assert (code, said) == (130, f"Stopped by {told}: nothing was moved or written.\n")


def test_once_the_exit_code_is_known_a_signal_does_not_change_it() -> None:
    assert struck(FINISHED, signal.SIGTERM) == (1, "")


@pytest.fixture
def heeded() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in early_signals.handled_signals()}
    early_signals.end_on_signals()
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_command_that_listens_to_nothing_itself_is_stopped_with_a_message(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    def command() -> int:
        os.kill(os.getpid(), getattr(signal, name))
        return 0

    assert run_to_exit_code(command) == 130
    assert capsys.readouterr().err.startswith("Stopped by ")


LEAVING = """
import signal, sys, time
from commands.terminal.early_signals import end_on_signals
end_on_signals()
class Last:
    def __del__(self):
        import os, signal
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
sys.last_of_all = Last()
print("leaving", flush=True)
sys.exit(4)
"""


def test_a_signal_while_the_interpreter_is_taken_down_does_not_change_how_it_ended() -> None:
    done = subprocess.run([sys.executable, "-c", LEAVING], check=False, capture_output=True, text=True, timeout=20)
    assert (done.returncode, done.stderr) == (4, "")
