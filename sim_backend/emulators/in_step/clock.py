"""The bench's clock in step with emulated devices: it asks them to let time pass, and stamps what they sent meanwhile.

Only the thread that waits lets time pass; what happens within a step is stamped when the step is over, and nobody
can act in between. So one question and one answer a step are enough, however many datagrams it holds.
"""

from __future__ import annotations

from rig.clock import SteppedClock, SteppedLine
from rig.errors import DeviceFault
from sim_backend.emulators.in_step.messages import LONGEST_STEP_S, PATIENCE_S, START_S, Channel, Request, Written


class InStepClock(SteppedClock):
    """Seconds that pass while they are waited for, together with those of the emulators.

    Parameters
    ----------
    channel
        The connection to them.
    patience_s
        How long, in seconds of the computer, an answer may take.
    """

    def __init__(self, channel: Channel, patience_s: float = PATIENCE_S) -> None:
        self._channel, self._patience_s = channel, patience_s
        self._now_s = START_S
        self._lines: dict[str, SteppedLine] = {}
        self._openings: dict[str, int] = {}
        self._asked = 0
        self._fault: DeviceFault | None = None

    def now_s(self) -> float:
        """The instant that was reached last."""
        return self._now_s

    def join(self, line: SteppedLine) -> None:
        """From here on the bytes of this line are stamped; it has just been opened."""
        self._lines[line.name] = line
        self._openings[line.name] = self._openings.get(line.name, 0) + 1

    def pause(self, duration_s: float) -> None:
        """Let so much time pass."""
        self.wait_until(self._now_s + duration_s)

    def wait_until(self, deadline_s: float) -> float:
        """Let time pass until the deadline. Raises DeviceFault where the emulators do not, now and ever after."""
        while self._now_s < deadline_s:
            if self._fault is not None:
                raise DeviceFault(str(self._fault))
            try:
                self._step(min(deadline_s, self._now_s + LONGEST_STEP_S))
            except OSError:
                self._fault = DeviceFault("the emulated devices, in step, have ended, and time with them")
            except DeviceFault as fault:
                self._fault = fault
        return self._now_s

    def _step(self, until_s: float) -> None:
        self._asked += 1
        written = {name: Written(self._openings[name], line.written_bytes) for name, line in self._lines.items()}
        self._channel.send(Request(self._asked, until_s, written))
        number = 0
        while number != self._asked:  # an answer may be left over from a step that Ctrl-C has cut short
            number, now_s, sent = self._channel.reply(self._patience_s)
            for name, (opening, plugged_in, arrivals) in sent.items():
                if opening == self._openings.get(name):
                    self._lines[name].stamp(arrivals, not plugged_in, self._patience_s)
            self._now_s = now_s

    def close(self) -> None:
        """Let go of the emulators, which then switch the torque off and end; safe twice."""
        self._channel.close()
