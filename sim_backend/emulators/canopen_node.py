"""The communication part of an emulated CANopen device (CiA 301): NMT, PDO, SYNC, heartbeat, EMCY; SDO passed on."""

from __future__ import annotations

from pathlib import Path

from drivers.codecs.cia402 import HEARTBEAT_CONSUMER, HEARTBEAT_PRODUCER, encode_emergency
from drivers.codecs.lawicel import CanFrame
from sim_backend.emulators.object_dictionary import (
    ABORT_STATE,
    ABORT_VALUE,
    ObjectDictionary,
    SdoAbort,
    SdoServer,
)

STATE_STOPPED, STATE_OPERATIONAL, STATE_PRE_OPERATIONAL = 4, 5, 127
_NMT_STATES = {0x01: STATE_OPERATIONAL, 0x02: STATE_STOPPED, 0x80: STATE_PRE_OPERATIONAL}
_NOT_VALID = 1 << 31
_NO_REMOTE_REQUEST = 1 << 30
_PDOS = 4


class CanopenNode:
    """A CANopen slave whose application overrides the ``on_...`` methods.

    Parameters
    ----------
    eds
        Its object dictionary.
    node
        Its node number, 1 to 127.
    """

    def __init__(self, eds: Path, node: int) -> None:
        self.node = node
        self.od = ObjectDictionary(eds, node)
        self._sdo = SdoServer(self.od)
        self._out: list[CanFrame] = []
        self.state = STATE_PRE_OPERATIONAL
        self._heartbeat_due_s = 0.0
        self._last_heard_s: float | None = None
        self._waiting_for_sync: dict[int, bytes] = {}
        self._event_due_s = dict.fromkeys(range(_PDOS), 0.0)
        for k in range(_PDOS):
            for base in (0x1600, 0x1A00):
                self.od.before_write[base + k] = self._mapping_guard(base + k)
            self.od.before_write[0x1800 + k] = self._identifier_guard(0x1800 + k)
        self._send(0x700 + node, b"\0")

    def _identifier_guard(self, index: int):  # type: ignore[no-untyped-def]
        def guard(subindex: int, data: bytes) -> None:
            never_asked = self.od.get(index, 1) & _NO_REMOTE_REQUEST
            if subindex == 1 and never_asked and not int.from_bytes(data, "little") & _NO_REMOTE_REQUEST:
                raise SdoAbort(ABORT_VALUE)  # it answers no remote requests, and says so

        return guard

    def _mapping_guard(self, index: int):  # type: ignore[no-untyped-def]
        def guard(subindex: int, data: bytes) -> None:
            if subindex and self.od.get(index):
                raise SdoAbort(ABORT_STATE)  # the count has to be zero while entries change
            if not subindex and data[0] and self._valid_pdo(index - 0x200):
                raise SdoAbort(ABORT_STATE)  # and the PDO not valid

        return guard

    def _valid_pdo(self, communication: int) -> bool:
        return not self.od.get(communication, 1) & _NOT_VALID

    # -- from the host ---------------------------------------------------------------------------

    def receive(self, frame: CanFrame, now_s: float) -> None:
        """Dispatch one frame."""
        can_id, data = frame.identifier, frame.data
        if can_id == 0x000 and len(data) == 2 and data[1] in (0, self.node):
            self._command(data[0], now_s)
        elif can_id == 0x600 + self.node:
            self._send(0x580 + self.node, self._sdo.answer(data))
        elif can_id == self.od.get(0x1005) & 0x7FF:
            self._on_sync(now_s)
        elif 0x700 < can_id <= 0x77F and not frame.remote:
            self._heard(can_id - 0x700, now_s)
        elif self.state == STATE_OPERATIONAL:
            self._receive_pdo(can_id, data, now_s)

    def _command(self, command: int, now_s: float) -> None:
        if command in (0x81, 0x82):
            self.on_reset(now_s)
            self._last_heard_s = None
            self.state = STATE_PRE_OPERATIONAL
            self._send(0x700 + self.node, b"\0")
            return
        before, self.state = self.state, _NMT_STATES.get(command, self.state)
        if before == STATE_OPERATIONAL != self.state:
            self.on_leaving_operational(now_s)

    def restart(self, now_s: float) -> None:
        """As after a dip of the supply."""
        self._command(0x81, now_s)

    def _heard(self, node: int, now_s: float) -> None:
        watched, _ = self._consumer()
        if node == watched:
            self._last_heard_s = now_s

    def _consumer(self) -> tuple[int, float]:
        """(node watched, seconds) of the first heartbeat consumer; (0, 0) where it is off."""
        value = self.od.get(HEARTBEAT_CONSUMER, 1)
        return value >> 16 & 0x7F, (value & 0xFFFF) * 1e-3

    def _receive_pdo(self, can_id: int, data: bytes, now_s: float) -> None:
        for k in range(_PDOS):
            cob = self.od.get(0x1400 + k, 1)
            if cob & _NOT_VALID or cob & 0x7FF != can_id:
                continue
            if self.od.get(0x1400 + k, 2) <= 240:
                self._waiting_for_sync[k] = data
            else:
                self._take_pdo(k, data, now_s)

    def _take_pdo(self, k: int, data: bytes, now_s: float) -> None:
        at = 0
        for index, subindex, size in self._mapping(0x1600 + k):
            part = data[at : at + size]
            at += size
            if len(part) == size:
                self.od.write(index, subindex, part)
        self.on_pdo(now_s)

    def _mapping(self, index: int) -> list[tuple[int, int, int]]:
        entries = [self.od.get(index, k + 1) for k in range(self.od.get(index))]
        return [(entry >> 16, entry >> 8 & 0xFF, (entry & 0xFF) // 8) for entry in entries]

    def _on_sync(self, now_s: float) -> None:
        if self.state != STATE_OPERATIONAL:
            return
        for k, data in sorted(self._waiting_for_sync.items()):
            self._take_pdo(k, data, now_s)
        self._waiting_for_sync.clear()
        self.on_sync(now_s)
        for k in range(_PDOS):
            if self._valid_pdo(0x1800 + k) and self.od.get(0x1800 + k, 2) <= 240:
                self._send_pdo(k)

    def _send_pdo(self, k: int) -> None:
        data = b"".join(self.od.read(index, subindex) for index, subindex, _ in self._mapping(0x1A00 + k))
        self._send(self.od.get(0x1800 + k, 1) & 0x7FF, data)

    # -- time ------------------------------------------------------------------------------------

    def tick(self, now_s: float) -> None:
        """Heartbeats out, heartbeat of the host watched, event timers."""
        producer_s = self.od.get(HEARTBEAT_PRODUCER) * 1e-3
        if producer_s and now_s >= self._heartbeat_due_s:
            self._heartbeat_due_s = now_s + producer_s
            self._send(0x700 + self.node, bytes([self.state]))
        watched, limit_s = self._consumer()
        if watched and limit_s and self._last_heard_s is not None and now_s - self._last_heard_s > limit_s:
            self._last_heard_s = None
            self.on_heartbeat_lost(now_s)
        if self.state == STATE_OPERATIONAL:
            self._event_timers(now_s)

    def _event_timers(self, now_s: float) -> None:
        for k in range(_PDOS):
            if not self._valid_pdo(0x1800 + k) or self.od.get(0x1800 + k, 2) < 254:
                continue
            period_s = self.od.get(0x1800 + k, 5) * 1e-3
            if period_s and now_s >= self._event_due_s[k]:
                self._event_due_s[k] = now_s + period_s
                self._send_pdo(k)

    # -- to the host -----------------------------------------------------------------------------

    def emergency(self, code: int, register: int) -> None:
        """Send an EMCY frame and remember the error register."""
        self.od.set(0x1001, register)
        self._send(0x80 + self.node, encode_emergency(code, register))

    def _send(self, can_id: int, data: bytes) -> None:
        self._out.append(CanFrame(can_id, data))

    def take_frames(self) -> list[CanFrame]:
        """Frames to send since the last call."""
        frames, self._out = self._out, []
        return frames

    # -- the application -------------------------------------------------------------------------

    def on_pdo(self, now_s: float) -> None:
        """Objects were written by a PDO."""

    def on_sync(self, now_s: float) -> None:
        """PDOs of this SYNC are taken, those that answer it are about to go out."""

    def on_reset(self, now_s: float) -> None:
        """NMT reset."""

    def on_leaving_operational(self, now_s: float) -> None:
        """NMT stop or pre-operational."""

    def on_heartbeat_lost(self, now_s: float) -> None:
        """The host's heartbeat did not come in time."""
