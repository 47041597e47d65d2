"""The terminal shows how it goes, and can neither hold up a tick nor go away unnoticed."""

from __future__ import annotations

import io
import os
import threading
import time

import pytest

from commands.terminal.display import LOST, SetBars, Terminal, plain
from rig.excitation import Sine, planned
from rig.sequencer import Progress
from rig.sequencer.lateness import Lateness
from rig.sequencer.recorder import SetStatistics

SET = planned((Sine(torque_nm=10, frequency_hz=5, duration_s=0.5),))[0]
PROGRESS = Progress("5 Hz", 0.25, 0.5, 2e-4, 1, 3, 9.5)
DONE = SetStatistics("5 Hz", Lateness([1e-4, 4e-4]), 1, 3, 10.0, True)


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


class Gone(io.StringIO):
    def write(self, text: str) -> int:
        raise OSError(5, "Input/output error")


class Stuck(Screen):
    """As after Ctrl-S: who writes waits."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()

    def write(self, text: str) -> int:
        self.go_on.wait()
        return super().write(text)


def show_a_set(stream: io.StringIO, quiet: bool = False) -> str:
    terminal = Terminal(stream, quiet)
    bars = SetBars(terminal)
    with terminal.writing():
        bars.set_begins(SET, 1, 5)
        bars.progress(PROGRESS)
        bars.set_ends(DONE)
    return stream.getvalue()


def test_a_set_has_a_bar_with_lateness_missed_ticks_drops_and_peak_torque() -> None:
    shown = show_a_set(Screen())
    assert (
        "set 1/5  5 Hz [############------------]   0.2/0.5 s  late 0.20 ms  missed ticks 1  lost 3  peak 9.500 N m"
        in shown
    )


@pytest.mark.parametrize("columns", [60, 80, 132])
def test_what_is_replaced_fits_into_one_line_of_the_terminal(columns: int) -> None:
    termios = pytest.importorskip("termios")
    far, near = os.openpty()
    termios.tcsetwinsize(near, (24, columns))
    with os.fdopen(near, "w") as stream:
        terminal = Terminal(stream)
        bars = SetBars(terminal)
        with terminal.writing():
            bars.set_begins(SET, 1, 5)
            bars.progress(PROGRESS)
            bars.set_ends(DONE)
            terminal.note("looking at a residual " * 10)
        shown = os.read(far, 10_000).decode()
    os.close(far)
    replaced = [line.split("\r")[0].rstrip("\n") for line in shown.split("\r\x1b[K")[1:]]
    assert max(len(line) for line in replaced if "peak 10.00 N m" not in line) < columns  # that one stays
    assert "peak 9.500 N m" in shown or columns < 80


def test_without_a_terminal_there_is_one_line_a_set() -> None:
    assert show_a_set(io.StringIO()) == (
        "set 1/5  5 Hz [########################] late 0.40 ms  missed ticks 1  samples lost 3  peak 10.00 N m\n"
    )


def test_a_set_that_was_cut_short_says_so() -> None:
    stream = io.StringIO()
    terminal = Terminal(stream)
    with terminal.writing():
        SetBars(terminal).set_ends(SetStatistics("5 Hz", Lateness(), 0, 0, 0.0, False))
    assert "CUT SHORT" in stream.getvalue()


def test_quiet_says_nothing_but_what_is_insisted_on() -> None:
    assert show_a_set(Screen(), quiet=True) == ""
    stream = io.StringIO()
    terminal = Terminal(stream, quiet=True)
    with terminal.writing():
        terminal.show("by the way")
        terminal.show_always("torque is REAL")
    assert stream.getvalue() == "torque is REAL\n"


def test_a_terminal_that_takes_nothing_holds_nobody_up_and_fills_no_memory() -> None:
    stuck = Stuck()
    terminal = Terminal(stuck)
    bars = SetBars(terminal)
    with terminal.writing():
        bars.set_begins(SET, 1, 1)
        begin = time.monotonic()
        for _ in range(10_000):
            bars.progress(PROGRESS)
        assert time.monotonic() - begin < 1.0
        stuck.go_on.set()
    assert stuck.getvalue().count("5 Hz") < 100


def test_a_terminal_that_is_gone_is_a_reason_to_stop() -> None:
    reasons: list[str] = []
    terminal = Terminal(Gone())
    terminal.on_loss = reasons.append
    with terminal.writing():
        terminal.show("one")
        terminal.show("two")
    assert reasons == [LOST]


def test_a_name_out_of_a_file_cannot_steer_the_terminal() -> None:
    assert plain("5 Hz\x1b[2J\r\n") == "5 Hz?[2J??"
