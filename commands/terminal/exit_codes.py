"""The one place that turns an exception into a message and an exit code."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

from commands.terminal.early_signals import STOPPED, accepting_aborts, fix_exit_code
from rig.errors import Aborted, DeviceFault, RigError, SafetyTrip, UsageError

OK, NOT_ACCEPTED, USAGE, INTERNAL = 0, 1, 2, 70  # and STOPPED, which an early signal needs
TRACEBACK_FILE = "traceback.txt"
# What the message opens with, the most particular kind first.
HEADINGS: tuple[tuple[type[BaseException], str], ...] = (
    (UsageError, "Error"),
    (DeviceFault, "Device fault"),
    (SafetyTrip, "Safety trip"),
    (Aborted, "Stopped"),
    (RigError, "Error"),
    (KeyboardInterrupt, "Stopped"),
)
LONGEST_SAID_WORD, LONGEST_SAID_LINE = 200, 2000  # of what is said; a file may hold a line of any length
_LONG_WORD = re.compile(rf"\S{{{LONGEST_SAID_WORD + 1},}}")
_DISK_FULL_ERRNOS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EFBIG}
Evidence = Callable[[], Path | None]  # the results folder as far as there is one


def no_results_folder() -> Path | None:
    """For commands that make no results folder."""
    return None


def run_to_exit_code(
    command: Callable[[], int], evidence: Evidence = no_results_folder, stopped: Callable[[], str | None] = lambda: None
) -> int:
    """Run ``command``; whatever it raises becomes a message on stderr and an exit code. Never raises.

    ``stopped`` says why somebody asked to stop, if anybody did. A library that is interrupted halfway (a compiler, say)
    may fail of it in any way: what comes then is the stop, not a fault of the program.
    """
    try:
        with accepting_aborts():
            code = command()
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (this is the place where all of them end)
        reason = stopped()
        if reason is not None and exit_code_of(as_rig_error(error)) == INTERNAL:
            _keep_traceback(error, evidence())
            error = Aborted(f"{reason}.")
        code = report(error, evidence())
    return _flushed(fix_exit_code(code))


def report(error: BaseException, folder: Path | None) -> int:
    """Say on stderr what went wrong and return the exit code; the traceback goes to ``folder`` only."""
    error = as_rig_error(error)
    say(message_of(error, folder))
    return exit_code_of(error)


def exit_code_of(error: BaseException) -> int:
    """The exit code of an error."""
    if isinstance(error, RigError):
        return error.exit_code
    return STOPPED if isinstance(error, KeyboardInterrupt) else INTERNAL


def as_rig_error(error: BaseException) -> BaseException:
    """A full disk, or a reader that has gone away, ends a campaign as Ctrl-C does; all else is what it is."""
    if isinstance(error, BrokenPipeError):
        return Aborted("the program that read the output has ended.")
    if isinstance(error, OSError) and error.errno in _DISK_FULL_ERRNOS:
        return Aborted(
            f"cannot write {error.filename or 'the results'}: {error.strerror}. What was written until then is "
            "kept; free space or choose another --out."
        )
    return error


def message_of(error: BaseException, folder: Path | None) -> str:
    """What to say of an error; of one that nobody foresaw a short line, and where the rest of it is."""
    for kind, heading in HEADINGS:
        if isinstance(error, kind):
            text = str(error) or "by Ctrl-C"
            return text if text.startswith(heading) else f"{heading}: {text}"
    where = traceback.extract_tb(error.__traceback__)
    at = f" in {Path(where[-1].filename).name}, line {where[-1].lineno}" if where else ""
    text = " ".join(str(error).split())[:300]
    kept = _keep_traceback(error, folder)
    return f"Internal error: {type(error).__name__}: {text}{at}. This is a bug in isp-rig.{kept}"


def _keep_traceback(error: BaseException, folder: Path | None) -> str:
    if folder is None or not folder.is_dir():
        return ""
    path = folder / TRACEBACK_FILE
    try:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(traceback.format_exception(error))
    except OSError as problem:
        return f" Its traceback could not be written to {path}: {problem.strerror}."
    return f" Its traceback is in {path}; please send it to the authors."


def hide_library_warnings() -> None:
    """What NumPy warns of says nothing to whoever stands at the bench; python -W shows it."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def say(text: str) -> None:
    """Write to stderr; a terminal that is gone must not stop what remains to be done.

    Messages quote names and paths from outside, which must not steer the terminal, turn its text around or fill it.
    """
    lines = (_LONG_WORD.sub(lambda word: _cut(word.group(), LONGEST_SAID_WORD), line) for line in text.split("\n"))
    short = "\n".join(_cut(line, LONGEST_SAID_LINE) for line in lines)
    shown = "".join(c if c.isprintable() or c == "\n" else "?" for c in short)
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(shown + "\n")
        sys.stderr.flush()


def _cut(text: str, most: int) -> str:
    """The beginning and the end, which may be the name of a file, of a text that is longer than ``most``."""
    return text if len(text) <= most else f"{text[: most - 60]}... ({len(text)} characters) ...{text[-30:]}"


def _flushed(code: int) -> int:
    """Flush here, where a reader that has gone away (`| head`) can be told from an error."""
    try:
        sys.stdout.flush()
    except OSError:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code
