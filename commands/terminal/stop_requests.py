"""What Ctrl-C and other signals do: the first ends the campaign in order, a second cuts the torque at once."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from enum import Enum
from types import FrameType

from commands.terminal.early_signals import SIGNALS, handled_signals
from rig.errors import Aborted

STOPPING = "Stopping: torque to zero, then saving. Ctrl-C again cuts the torque at once."
AGAIN_S = 0.02  # until the signal strikes again: the callback has returned by then
SAVING = "Stopping after the current file is saved."


def _strike() -> None:
    """Ctrl-C, to the thread that handles signals: it wakes from whatever it waits for."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)


class _Stage(Enum):
    IDLE = "a signal raises where it strikes"
    TICKING = "the sequencer asks at every tick"
    SAVING = "what is being written is finished first"


class StopRequests:
    """Who asked to stop, if anybody did.

    While ticks run the sequencer asks ``poll`` and ends in order. Before the first tick nothing asks, so the
    signal raises there, and leaves through the same doors. ``tell`` says a line to the operator; it is called
    from the signal handler and must never wait.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self.show: Callable[[str], None] = lambda text: None
        self._torque_off: Callable[[], None] | None = None
        self._stage = _Stage.IDLE
        self._is_acted_on = False  # whether somebody has acted on the reason
        self._lost: BaseException | None = None  # raised where nothing can be raised: it has to be raised again

    def poll(self) -> str | None:
        """The reason to stop, or None. Asked by the sequencer at every tick."""
        self._stage = _Stage.TICKING
        self._is_acted_on = self.reason is not None
        return self.reason

    def outstanding(self) -> str | None:
        """The reason to stop where nobody has acted on it yet, else None. Whoever asks has to act on it."""
        if self._is_acted_on or self.reason is None:
            return None
        self._is_acted_on = True
        return self.reason

    def request(self, reason: str) -> None:
        """Ask to stop, from any thread; the first reason counts."""
        self.reason = self.reason or reason

    @contextlib.contextmanager
    def playing(self, torque_off: Callable[[], None]) -> Iterator[None]:
        """While this holds there may be torque, and ``torque_off`` is the shortest road to none."""
        earlier = self._stage
        self._torque_off, self._stage = torque_off, _Stage.IDLE
        try:
            yield
        finally:
            self._torque_off, self._stage = None, earlier

    @contextlib.contextmanager
    def deferring(self) -> Iterator[None]:
        """A signal in here raises nothing; whoever holds this asks ``outstanding`` before it goes on."""
        earlier = self._stage
        self._stage = _Stage.SAVING
        try:
            yield
        finally:
            self._stage = earlier

    @contextlib.contextmanager
    def saving(self) -> Iterator[None]:
        """What is written in here is written whole. Raises Aborted at the end where somebody has asked to stop."""
        with self.deferring():
            yield
        reason = self.outstanding()
        if reason is not None:
            raise Aborted(f"{reason}.")

    @contextlib.contextmanager
    def handling_signals(self) -> Iterator[None]:
        """Handlers in place; those from before are put back."""
        earlier = {number: signal.signal(number, self._handle) for number in handled_signals()}
        hook = sys.unraisablehook
        sys.unraisablehook = lambda lost: self._again(lost.exc_value) or hook(lost)
        try:
            yield
        finally:
            sys.unraisablehook = hook
            for number, handler in earlier.items():
                signal.signal(number, handler)

    def _again(self, lost: BaseException | None) -> bool:
        """A signal that struck in a callback of C, where what it raises is dropped, strikes once more."""
        if not isinstance(lost, (Aborted, KeyboardInterrupt)):
            return False
        self._lost = lost
        threading.Timer(AGAIN_S, _strike).start()
        return True

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        lost, self._lost = self._lost, None
        if lost is not None:
            if self._stage is not _Stage.SAVING:
                raise lost
            return
        is_first = self.reason is None
        self.request(f"Stopped by {SIGNALS[signal.Signals(number).name]}")
        if is_first and self._stage is _Stage.TICKING:
            self.show(STOPPING)
        elif is_first and self._stage is _Stage.SAVING:
            self.show(SAVING)
        elif is_first and self._stage is _Stage.IDLE:
            raise Aborted(f"{self.reason}.")
        elif number == signal.SIGINT and not is_first:
            if self._torque_off is not None:
                self._torque_off()
            raise KeyboardInterrupt
