"""Status of a CiA 402 drive: state, NMT state, its heartbeat, emergencies, and whether they are in order."""

from __future__ import annotations

from drivers.bounded_log import FirstAndLast
from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from drivers.transport.can_link import ReceivedFrame
from rig.errors import DeviceFault

NMT_OPERATIONAL = 0x05
MISSED_BEATS = 3.0  # periods of the heartbeat without one: the drive is silent


class DriveStatus:
    """Fed with every frame of the drive.

    Parameters
    ----------
    node, heartbeat_s
        Its number, and how often it is told to give a sign of life.
    label
        What messages call it.
    """

    def __init__(self, node: int, heartbeat_s: float, label: str) -> None:
        self._tpdo_id, self._emergency_id, self._beat_id = 0x180 + node, 0x80 + node, 0x700 + node
        self._limit_s, self._label = MISSED_BEATS * heartbeat_s, label
        self._last_beat_s: float | None = None
        self._nmt_state: int | None = None
        self.statusword = 0
        self.emergencies: FirstAndLast[tuple[float, str]] = FirstAndLast()
        self.new_emergency = ""

    @property
    def state(self) -> State | None:
        """State of the drive by its last statusword."""
        return cia402.state_of(self.statusword)

    def begin(self, now_s: float) -> None:
        """The drive was just enabled: from here on it has to be heard."""
        self._last_beat_s = now_s
        self._nmt_state = None  # the last heartbeat may have been sent before the drive was started

    def receive(self, heard: ReceivedFrame) -> bytes | None:
        """Take note of a frame; the bytes behind the statusword where it was the status PDO."""
        can_id, data = heard.frame.identifier, heard.frame.data
        if can_id == self._tpdo_id and len(data) >= 2:
            self.statusword = int.from_bytes(data[:2], "little")
            return data[2:]
        if can_id == self._beat_id and data:
            self._last_beat_s, self._nmt_state = heard.time_s, data[0] & 0x7F
        elif can_id == self._emergency_id and len(data) >= 3:
            code, register, _ = cia402.decode_emergency(data)
            text = f"EMCY 0x{code:04X} {cia402.emergency_in_words(code)} (register 0x{register:02X})"
            self.emergencies.append((heard.time_s, text))
            self.new_emergency = text if code else ""
        return None

    def check(self, now_s: float) -> None:
        """Emergency, state, NMT state, silence. Raises DeviceFault for the first that is not well."""
        if self.new_emergency:
            raise DeviceFault(f"{self._label}: {self.new_emergency}")
        if self.state is not State.ENABLED:
            name = self.state.value if self.state else f"statusword 0x{self.statusword:04X}"
            raise DeviceFault(
                f"{self._label} left 'operation enabled' by itself and is in '{name}': look into its error history "
                "(0x1003) and at its enable and emergency-stop inputs"
            )
        if self._nmt_state is not None and self._nmt_state != NMT_OPERATIONAL:
            raise DeviceFault(
                f"{self._label} left NMT state operational (now {self._nmt_state}): it was reset or lost its supply"
            )
        if self._last_beat_s is not None and now_s - self._last_beat_s > self._limit_s:
            raise DeviceFault(
                f"{self._label} is silent: no heartbeat for {(now_s - self._last_beat_s) * 1e3:.0f} ms "
                f"(limit {self._limit_s * 1e3:.0f} ms): check its supply and the CAN cable"
            )
