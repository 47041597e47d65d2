"""An emulated drive behind a python-can bus without wire, thread or waiting: time passes when it is asked for."""

from __future__ import annotations

import can

from drivers.codecs.lawicel import CanFrame

TICK_S = 0.2e-3


class FakeTime:
    """A clock that moves on by a fifth of a millisecond with every look, so that time-outs are reached."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        self.now_s += TICK_S
        return self.now_s


class LookedAt:
    """That time as a host's clock: whoever waits looks at it until the time has come."""

    def __init__(self, time: FakeTime) -> None:
        self.now_s = time

    def wait_until(self, deadline_s: float) -> float:
        while (now_s := self.now_s()) < deadline_s:
            pass
        return now_s

    def pause(self, duration_s: float) -> None:
        """None passes but by looking."""


class EmulatedBus(can.BusABC):
    """Frames go straight to an emulated drive and back."""

    def __init__(self, drive, time) -> None:
        self.drive, self.time = drive, time
        self.sent: list[CanFrame] = []
        self._waiting: list[CanFrame] = []
        self.silent = False
        self.channel_info = "emulated bus"
        super().__init__(channel="emulated")

    def send(self, msg, timeout=None):
        frame = CanFrame(msg.arbitration_id, bytes(msg.data), msg.is_extended_id, msg.is_remote_frame, msg.dlc)
        self.sent.append(frame)
        if not self.silent:
            self.drive.receive(frame, self.time.now_s)

    def _recv_internal(self, timeout):
        self.drive.tick(self.time.now_s)
        frames = self.drive.take_frames()
        if not self.silent:
            self._waiting += frames
        if not self._waiting:
            return None, False
        frame = self._waiting.pop(0)
        return can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=frame.extended), False
