"""Signals before the command has set up its own handling, and after it has ended.

Nothing heavy may be imported here: this comes before all that is slow to import.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
from collections.abc import Iterator
from types import FrameType

# By name: not every system has all of them.
SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "the loss of the terminal", "SIGBREAK": "Ctrl-Break"}
STOPPED = 130

_exit_code: int | None = None  # the exit code, once it is known
_is_accepting_aborts = False


def handled_signals() -> list[int]:
    """Numbers of the signals that end a command: all that there are, and SIGHUP unless it is ignored (nohup)."""
    found = [(name, getattr(signal, name, None)) for name in SIGNALS]
    ignored = signal.SIG_IGN
    return [n for name, n in found if n is not None and not (name == "SIGHUP" and signal.getsignal(n) is ignored)]


def end_on_signals() -> None:
    """From here on a signal ends the program without a traceback. Called once, by whatever is the program."""
    for number in handled_signals():
        signal.signal(number, _handle)
    atexit.register(_leave_undisturbed)


@contextlib.contextmanager
def accepting_aborts() -> Iterator[None]:
    """While this holds there is somebody who catches ``Aborted``; before, nothing was begun."""
    global _is_accepting_aborts  # noqa: PLW0603  a process has one set of signal handlers
    _is_accepting_aborts = True
    try:
        yield
    finally:
        _is_accepting_aborts = False


def fix_exit_code(code: int) -> int:
    """The exit code is known: a signal on the way out does not change it. Returns it."""
    global _exit_code  # noqa: PLW0603
    _exit_code = code
    return code


def _leave_undisturbed() -> None:
    """On its way out the interpreter puts back handlers that kill; by then all is written."""
    for number in handled_signals():
        signal.signal(number, signal.SIG_IGN)


def _handle(number: int, _frame: FrameType | None) -> None:
    name = SIGNALS[signal.Signals(number).name]
    if _is_accepting_aborts:
        from rig.errors import Aborted

        raise Aborted(f"Stopped by {name}.")
    if _exit_code is None:
        with contextlib.suppress(OSError):
            os.write(2, f"Stopped by {name}: nothing was moved or written.\n".encode())
    os._exit(STOPPED if _exit_code is None else _exit_code)
