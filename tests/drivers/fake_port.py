"""Byte ports for tests: an adapter in the same process, and one that has vanished."""

from __future__ import annotations

from drivers.transport.ports import gone, stalled
from sim_backend.emulators.adapter import LawicelAdapter


class AdapterPort:
    """A Lawicel adapter whose bus is a list; ``on_frame`` sees what the host sends."""

    name = "fake adapter"

    def __init__(self, on_frame=None, clock=lambda: 12.345) -> None:
        self.frames = []
        self.adapter = LawicelAdapter(on_frame or self.frames.append, clock)
        self.waiting = b""
        self.mute = self.vanished = self.stuck = False

    def read(self):
        if self.vanished:
            raise gone(self.name, "test")
        data, self.waiting = self.waiting, b""
        return data

    def write(self, data, timeout_s=0.1):
        if self.stuck:
            raise stalled(self.name, len(data), timeout_s)
        answer = self.adapter.feed(data)
        if not self.mute:
            self.waiting += answer

    def wait_readable(self, timeout_s):
        return bool(self.waiting)

    def close(self):
        self.waiting = b""
