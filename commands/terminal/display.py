"""The display on stderr while a campaign plays.

Nothing here may hold up a tick: a terminal that is stopped (Ctrl-S) or slow blocks whoever writes to it. So a
thread writes, and the loop only hands over short lines. A terminal that is gone is a reason to stop.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import TextIO

from rig.excitation import PlannedSet
from rig.rounding import rounded_down
from rig.sequencer import Observer, Progress
from rig.sequencer.recorder import SetStatistics

BAR_WIDTH, MIN_BAR_WIDTH = 24, 6  # characters; a narrow terminal gets a shorter bar, or none
NO_TERMINAL_COLUMNS = 120  # of a line where there is no terminal
MAX_WAITING_LINES = 50  # lines; a terminal that takes none loses bars, not memory
DRAIN_TIMEOUT_S = 1.0  # how long a slow terminal is waited for at the end
LOST = "Stopped because the terminal was closed"


def plain(text: str) -> str:
    """``text`` without what could steer a terminal: names come out of files."""
    return "".join(c if c.isprintable() else "?" for c in text)


def counted(count: int, thing: str) -> str:
    """ "1 run", "2 runs"."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def discard_typed_ahead(stream: TextIO) -> None:
    """Drop what was typed on a terminal and not read yet: it answers no question that was asked later.

    Nothing is dropped where ``stream`` is no terminal.
    """
    if not stream.isatty():
        return
    if sys.platform == "win32":
        import msvcrt

        while msvcrt.kbhit():
            msvcrt.getwch()
        return
    import termios

    with contextlib.suppress(termios.error):
        termios.tcflush(stream.fileno(), termios.TCIFLUSH)


class Terminal:
    """A stream that never keeps its writer waiting.

    Parameters
    ----------
    stream
        Where to write.
    quiet
        Say nothing of how it goes. Errors do not pass through here.
    """

    def __init__(self, stream: TextIO, quiet: bool = False) -> None:
        self.quiet = quiet
        self.has_bars = stream.isatty() and not quiet
        self.on_loss: Callable[[str], None] = lambda why: None  # called once, from the writing thread
        self._stream = stream
        self._lines: SimpleQueue[str | threading.Event | None] = SimpleQueue()
        self._is_open_line = False

    def columns(self) -> int:
        """Characters that fit into a line; asked anew each time, because windows are resized."""
        with contextlib.suppress(OSError, ValueError):
            return os.get_terminal_size(self._stream.fileno()).columns or NO_TERMINAL_COLUMNS
        return NO_TERMINAL_COLUMNS

    @contextmanager
    def writing(self) -> Iterator[None]:
        """While this holds, lines are written; what still waits is written at the end, if it can be."""
        thread = threading.Thread(target=self._write, name="terminal", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._end_line()
            self._lines.put(None)
            thread.join(DRAIN_TIMEOUT_S)

    def _write(self) -> None:
        lost = False
        while (item := self._lines.get()) is not None:
            if isinstance(item, threading.Event):
                item.set()
            elif not lost:
                try:
                    self._stream.write(item)
                    self._stream.flush()
                except (OSError, ValueError):
                    lost = True
                    self.on_loss(LOST)

    def show(self, text: str) -> None:
        """Say something in a line of its own, unless quiet. Safe from a signal handler."""
        if not self.quiet:
            self._end_line()
            self._lines.put(text + "\n")

    def show_always(self, text: str) -> None:
        """Say something in a line of its own, even if quiet."""
        self._end_line()
        self._lines.put(text + "\n")

    def note(self, text: str) -> None:
        """Say what is being worked on: in passing on a terminal, a line each elsewhere."""
        if self.has_bars:
            self.overwrite(text)
        else:
            self.show(text)

    def overwrite(self, text: str) -> None:
        """Put ``text`` in the place of the line that was put here last, cut to one line: only that can be replaced."""
        if self.has_bars and self._lines.qsize() < MAX_WAITING_LINES:
            self._is_open_line = True
            self._lines.put(f"\r\x1b[K{text[: self.columns() - 1]}")

    def _end_line(self) -> None:
        if self._is_open_line:
            self._is_open_line = False
            self._lines.put("\n")

    def clear_line(self) -> None:
        """Take back the line that was put here last."""
        if self._is_open_line:
            self._is_open_line = False
            self._lines.put("\r\x1b[K")

    def flush(self) -> None:
        """Wait until what was told is written, but not for ever; then others may write there."""
        self.clear_line()
        written = threading.Event()
        self._lines.put(written)
        written.wait(DRAIN_TIMEOUT_S)


class SetBars(Observer):
    """A bar a set on a terminal, a line a set elsewhere."""

    def __init__(self, terminal: Terminal) -> None:
        self._terminal = terminal
        self._head = ""

    def probed(self, finding: str) -> None:
        """What the probe found."""
        self._terminal.show(plain(finding))

    def set_begins(self, planned: PlannedSet, number: int, count: int) -> None:
        """Which set it is."""
        self._head = f"set {number}/{count}  {plain(planned.name)}"

    def progress(self, progress: Progress) -> None:
        """Where it stands."""
        p = progress
        figures = _figures(p.late_max_s, p.missed_ticks, p.drops, p.peak_torque_nm)
        rest = f"{p.time_s:5.1f}/{p.duration_s:g} s  {figures}".replace("samples lost", "lost")  # room is short here
        self._terminal.overwrite(self._line(p.time_s / p.duration_s, rest))

    def set_ends(self, statistics: SetStatistics) -> None:
        """How it went."""
        s = statistics
        figures = _figures(s.late.max_s, s.missed_ticks, s.drops, s.peak_torque_nm)
        self._terminal.clear_line()
        self._terminal.show(self._line(1.0, figures) if s.complete else f"{self._head} CUT SHORT {figures}")

    def _line(self, part: float, rest: str) -> str:
        """The set, a bar as long as there is room for, and ``rest``."""
        room = self._terminal.columns() - len(f"{self._head} [] {rest}") - 1
        bar = _bar(part, min(BAR_WIDTH, room)) if room >= MIN_BAR_WIDTH else ""
        return " ".join(piece for piece in (self._head, bar, rest) if piece)


def _bar(part: float, width: int) -> str:
    full = round(width * min(1.0, max(0.0, part)))
    return f"[{'#' * full}{'-' * (width - full)}]"


def _figures(late_s: float, missed: int, drops: int, peak_nm: float) -> str:
    return f"late {late_s * 1e3:.2f} ms  missed ticks {missed}  samples lost {drops}  peak {rounded_down(peak_nm)} N m"
