"""The interface of every emulated drive: frames out, torque on the shaft, events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from drivers.codecs.lawicel import CanFrame

SETTLED_ZERO_S = 0.005  # a sine through zero is no event; torque that stays at zero for so long is


@dataclass(frozen=True)
class Event:
    """Something the drive did ("enabled", "torque_zero", "watchdog", "fault", "disabled"), or an "injected" fault."""

    name: str
    time_s: float
    before_nm: float
    after_nm: float
    detail: str = ""

    def as_json(self) -> dict[str, object]:
        """The fields of its JSON line; ``torque_nm`` is [before, after]."""
        line: dict[str, object] = {
            "event": self.name,
            "time_s": self.time_s,
            "torque_nm": [self.before_nm, self.after_nm],
        }
        return line | ({"detail": self.detail} if self.detail else {})


class EmulatedDrive(Protocol):
    """A drive on the emulated bus."""

    @property
    def torque_nm(self) -> float:
        """Torque on the shaft now."""
        ...

    def receive(self, frame: CanFrame, now_s: float) -> None:
        """A frame from the host."""
        ...

    def acts_at(self, now_s: float) -> float:
        """The instant, by the drive's own clock and no later, at which it acts on what reached it at ``now_s``."""
        ...

    def tick(self, now_s: float) -> None:
        """Let time pass: watchdogs, heartbeats, timers."""
        ...

    def fail(self, code: int, now_s: float) -> None:
        """Go to fault by itself, with a code of the maker's."""
        ...

    def restart(self, now_s: float) -> None:
        """As after a dip of the supply."""
        ...

    def take_frames(self) -> list[CanFrame]:
        """Frames to send since the last call."""
        ...

    def take_events(self, now_s: float) -> list[Event]:
        """Events since the last call."""
        ...


@dataclass
class TorqueOutput:
    """Torque on the shaft with its events."""

    torque_nm: float = 0.0
    _events: list[Event] = field(default_factory=list)
    _zero_since: Event | None = None

    def apply(self, torque_nm: float, now_s: float, because: str = "", detail: str = "") -> None:
        """Put a torque on the shaft; ``because`` names the event that did it, if any."""
        before, self.torque_nm = self.torque_nm, torque_nm
        if because:
            self._events.append(Event(because, now_s, before, torque_nm, detail))
        if torque_nm != 0.0:
            self._zero_since = None
        elif before != 0.0:
            self._zero_since = Event("torque_zero", now_s, before, 0.0)
            if because:
                self._events.append(self._zero_since)
                self._zero_since = None

    def take_events(self, now_s: float) -> list[Event]:
        """Events so far; a zero is told once it has lasted, with the time at which it began."""
        if self._zero_since is not None and now_s - self._zero_since.time_s >= SETTLED_ZERO_S:
            self._events.append(self._zero_since)
            self._zero_since = None
        events, self._events = self._events, []
        return events
