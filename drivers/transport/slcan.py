"""A python-can bus for serial (Lawicel, slcan) adapters that reads in bulk and checks the adapter's answers.

python-can's own ``slcan`` reads byte by byte (thirty times more processor time a frame) and never looks at
what the adapter answers, so that sending on a closed channel raises nothing. Registered with python-can as
interface ``slcan_bulk``::

    bus = can.Bus(interface="slcan_bulk", channel="/dev/ttyACM0", bitrate=1_000_000)
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import can
from can import CanInitializationError, CanOperationError, Message

from drivers.codecs import lawicel
from drivers.codecs.lawicel import Answer, CanFrame, LawicelDecoder
from drivers.transport.listening import arrivals
from drivers.transport.ports import BytePort, SerialPort
from rig.errors import DeviceFault

MAX_ANSWER_S = 0.06  # an answer to a frame that takes longer: what is sent does not reach the bus in time
LONGEST_FLUSH_S = 1.0  # for frames that were on their way when the channel was closed
QUIET_S = 0.05  # of silence, after which an adapter has sent everything


class SlcanBulkBus(can.BusABC):
    """CAN bus behind a Lawicel adapter.

    Parameters
    ----------
    channel
        Serial port of the adapter, or an object with the methods of ``drivers.transport.ports.BytePort``.
    bitrate
        Bits a second on the CAN side; one of those in ``lawicel.BIT_RATE_CODES``.
    tty_baudrate
        Baud rate of the serial side; without meaning for native USB adapters. A frame is 22 characters:
        115200 baud carries 500 frames a second, too few for 1 kHz.
    listen_only
        Open without acknowledging or sending.
    timestamps
        Ask for the adapter's millisecond time stamps (Z1) and put them on the host's clock.
    answer_timeout_s
        How long a command, or a run of sent frames, may stay unanswered.
    clock
        Host time in seconds.
    """

    def __init__(
        self,
        channel: str | BytePort,
        bitrate: int = 1_000_000,
        tty_baudrate: int = 115_200,
        listen_only: bool = False,
        timestamps: bool = False,
        answer_timeout_s: float = 0.5,
        clock: Callable[[], float] = time.monotonic,
        **kwargs: Any,
    ) -> None:
        if bitrate not in lawicel.BIT_RATE_CODES:
            allowed = ", ".join(map(str, lawicel.BIT_RATE_CODES))
            raise ValueError(f"bitrate {bitrate} is not one of a Lawicel adapter: {allowed}")
        self._answer_timeout_s = answer_timeout_s
        self._decoder = LawicelDecoder()
        self._frames: deque[tuple[float, CanFrame]] = deque()  # with the time of their arrival
        self.clock = clock
        self._unanswered: deque[float] = deque()  # when each was sent
        self._looked_s = 0.0
        self._answers_frames: bool | None = None
        self._answers: deque[Answer] = deque()
        self._clock_offset_s: float | None = None
        self._last_stamp_ms = 0
        self._stamp_turns = 0
        try:
            self._port = SerialPort(channel, tty_baudrate) if isinstance(channel, str) else channel
        except DeviceFault as problem:
            raise CanInitializationError(str(problem)) from None
        self.channel_info = f"slcan_bulk: {self._port.name}"
        self._can_protocol = can.CanProtocol.CAN_20
        try:
            self._start(bitrate, listen_only, timestamps)
        except (CanOperationError, DeviceFault) as problem:
            self._port.close()
            self._is_shutdown = True
            raise CanInitializationError(str(problem)) from None
        super().__init__(channel=self._port.name, **kwargs)

    def _start(self, bitrate: int, listen_only: bool, timestamps: bool) -> None:
        # Ends whatever half a command an earlier program left behind, and closes the channel if it is open;
        # the answers to that mean nothing and are waited out.
        self._port.write(b"\r\r\rC\r")
        talks_until_s = self.clock() + LONGEST_FLUSH_S
        while self._port.wait_readable(QUIET_S):
            self._port.read()
            if self.clock() > talks_until_s:
                raise DeviceFault(
                    f"{self._port.name} is still sending {LONGEST_FLUSH_S:g} s after the command to close its channel: "
                    "it is not a Lawicel adapter, or its baud rate differs. Check whether the ports of gyroscope and "
                    "adapter are swapped (bench.amplifier.can.channel)."
                )
        self._ask(lawicel.BIT_RATE_CODES[bitrate])
        self._ask("Z1" if timestamps else "Z0", may_refuse=not timestamps)
        self._ask("L" if listen_only else "O")

    def _ask(self, command: str, may_refuse: bool = False) -> Answer:
        """Send a command and return the adapter's answer; frames that come in between are kept."""
        self._answers.clear()
        self._port.write(command.encode("ascii") + lawicel.ANSWER_OK)
        deadline = self.clock() + self._answer_timeout_s
        while True:
            while self._answers:
                answer = self._answers.popleft()
                if answer.kind in ("ok", command[0]):
                    return answer
                if answer.kind == "error":
                    if may_refuse:
                        return answer
                    raise CanOperationError(f"{self._port.name}: the adapter refused the command {command!r}")
            left = deadline - self.clock()
            if left <= 0 or not self._port.wait_readable(left):
                raise CanOperationError(
                    f"{self._port.name}: no answer to {command!r} within {self._answer_timeout_s} s. "
                    "Is it a Lawicel (slcan) adapter, and is the baud rate right?"
                )
            self._take()

    def _take(self) -> None:
        """Sort what has come from the adapter into frames and answers."""
        for at_s, data in arrivals(self._port, self.clock):
            self._sort(at_s, data)

    def _sort(self, at_s: float, data: bytes) -> None:
        refused = 0
        for item in self._decoder.feed(data):
            if isinstance(item, CanFrame):
                self._frames.append((at_s, item))
            elif self._unanswered and item.kind in ("sent", "ok", "error"):
                self._unanswered.popleft()
                self._answers_frames = True
                refused += item.kind == "error"
            else:
                self._answers.append(item)
        if refused:
            raise CanOperationError(
                f"{self._port.name}: the adapter refused {refused} frame(s): channel not open, transmit queue "
                "full or bus off. Check termination and that another node acknowledges what is sent."
            )

    def _message(self, frame: CanFrame, now_s: float) -> Message:
        return Message(
            arbitration_id=frame.identifier,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
            dlc=frame.length if frame.remote else len(frame.data),
            data=frame.data,
            timestamp=now_s if frame.timestamp_ms < 0 else self._on_host_clock(frame.timestamp_ms, now_s),
            is_rx=True,
        )

    def _on_host_clock(self, stamp_ms: int, now_s: float) -> float:
        if stamp_ms < self._last_stamp_ms - lawicel.TIMESTAMP_MODULO_MS // 2:
            self._stamp_turns += 1
        self._last_stamp_ms = stamp_ms
        adapter_s = (stamp_ms + self._stamp_turns * lawicel.TIMESTAMP_MODULO_MS) * 1e-3
        offset = now_s - adapter_s
        # A frame is never read before it arrived, so the smallest offset seen is the best one.
        if self._clock_offset_s is None or offset < self._clock_offset_s:
            self._clock_offset_s = offset
        return adapter_s + self._clock_offset_s

    def fileno(self) -> int:
        """File descriptor to wait on, or -1."""
        number = getattr(self._port, "fileno", lambda: None)()
        return -1 if number is None else number

    def send(self, msg: Message, timeout: float | None = None) -> None:
        """Hand a frame to the adapter.

        Raises
        ------
        can.CanOperationError
            If an earlier frame was refused or stayed unanswered, or the adapter is stalled or gone.
        """
        frame = CanFrame(msg.arbitration_id, bytes(msg.data), msg.is_extended_id, msg.is_remote_frame, msg.dlc)
        self.send_lines((frame,), 0.1 if timeout is None else timeout)

    def send_lines(self, frames: Sequence[CanFrame], timeout: float = 0.1, urgent: bool = False) -> None:
        """Hand over several frames in one write: what belongs to one tick leaves in one go.

        ``urgent`` ends whatever half a line a write that was interrupted may have left in the adapter.

        Raises
        ------
        can.CanOperationError
            As ``send`` does.
        """
        lines = b"".join(map(lawicel.encode_frame, frames))
        self._count_unanswered(len(frames), urgent)  # before the write: a fast adapter answers during it
        try:
            self._port.write(lawicel.ANSWER_OK + lines if urgent else lines, timeout)
            self._take()
        except DeviceFault as problem:
            raise CanOperationError(str(problem)) from None

    def _count_unanswered(self, frames: int, urgent: bool) -> None:
        """Note what is about to be sent. Raises CanOperationError where earlier frames wait too long.

        What is urgent is sent all the same; and answers that nobody fetched meanwhile are not the adapter's fault.
        """
        now, waiting = self.clock(), self._unanswered
        late = bool(waiting) and now - waiting[0] > MAX_ANSWER_S and now - self._looked_s < MAX_ANSWER_S
        if late and self._answers_frames and not urgent:
            raise CanOperationError(
                f"{self._port.name}: {len(waiting)} frames unanswered for {(now - waiting[0]) * 1e3:.0f} ms (limit "
                f"{MAX_ANSWER_S * 1e3:.0f} ms): the adapter has stalled, is too slow, or loses frames"
            )
        self._looked_s = now
        waiting.extend([now] * frames)

    def _recv_internal(self, timeout: float | None) -> tuple[Message | None, bool]:
        if not self._frames:
            try:
                self._take()
                if not self._frames and timeout != 0:
                    self._wait_for_frame(timeout)
            except DeviceFault as problem:
                raise CanOperationError(str(problem)) from None
        if not self._frames:
            return None, False
        at_s, frame = self._frames.popleft()
        return self._message(frame, time.time() - (self.clock() - at_s)), False

    def take_frames(self) -> list[tuple[float, CanFrame]]:
        """Every frame that has arrived, with the time of its arrival on ``clock`` and without a message object each.

        Filters do not apply.

        Raises
        ------
        can.CanOperationError
            As ``recv`` does.
        """
        try:
            self._take()
        except DeviceFault as problem:
            raise CanOperationError(str(problem)) from None
        frames = list(self._frames)
        self._frames.clear()
        return frames

    def _wait_for_frame(self, timeout: float | None) -> None:
        deadline = None if timeout is None else self.clock() + timeout
        while not self._frames:
            left = 1.0 if deadline is None else deadline - self.clock()
            if left <= 0:
                return
            if self._port.wait_readable(left):
                self._take()

    @property
    def dropped_lines(self) -> int:
        """Lines from the adapter that were neither frame nor answer."""
        return self._decoder.dropped_lines

    @property
    def answers_frames(self) -> bool | None:
        """Whether the adapter acknowledges sent frames; None before any has been."""
        return self._answers_frames

    def status_flags(self) -> str:
        """The adapter's error flags in words, "" when all is well; waits for the answer."""
        return lawicel.flags_in_words(self._ask("F").text or "0")

    def version(self) -> str:
        """Hardware and firmware version as the adapter prints it; waits for the answer."""
        return self._ask("V").text

    def shutdown(self) -> None:
        """Close the channel and the port."""
        if not self._is_shutdown:
            super().shutdown()
            try:
                self._port.write(b"C\r")
            except DeviceFault:
                pass  # an adapter that is gone needs no closing
            finally:
                self._port.close()
