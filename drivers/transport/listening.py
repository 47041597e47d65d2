"""A port read by a thread of its own, which stamps bytes as they arrive.

Reading a serial port makes the kernel wait for its own worker thread, which on a busy machine gets its turn
milliseconds later. A control loop that reads would wait with it and miss its deadline; here only the
listener waits. It takes in and stamps, nothing else: decoding, checks and every answer, above all the sign
of life that the drive's watchdog waits for, stay with the loop.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from drivers.transport.ports import BytePort
from rig.errors import DeviceFault

MAX_CHUNKS = 100_000  # half a minute of a loop that hangs; then the oldest go
LISTEN_S = 0.05  # between two looks at whether to stop


class ListeningPort:
    """Wraps a port; same methods, and ``arrived`` with the times.

    Parameters
    ----------
    port
        An open port, left to this one from here on.
    clock
        Host time in seconds.
    """

    def __init__(self, port: BytePort, clock: Callable[[], float] = time.monotonic) -> None:
        self._port, self._clock = port, clock
        # Appending and taking are each done at once, so that no lock can hold either thread up.
        self._chunks: deque[tuple[float, bytes]] = deque(maxlen=MAX_CHUNKS)
        self._something = threading.Event()
        self._fault: DeviceFault | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._listen, name=f"listening on {port.name}", daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        try:
            while not self._closing:
                if self._port.wait_readable(LISTEN_S) and (data := self._port.read()):
                    self._take_in(data)
                    self._wake()
        except DeviceFault as fault:
            self._fault = fault
        except (OSError, ValueError) as problem:  # the port was taken away under a waiting read
            self._fault = DeviceFault(f"{self._port.name}: {problem}")
        self._wake()

    def _take_in(self, data: bytes) -> None:
        """Stamp and keep what was read; called by the listening thread."""
        self._chunks.append((self._clock(), data))

    def _wake(self) -> None:
        """Tell whoever waits that there is something to look at; called by the listening thread."""
        self._something.set()

    @property
    def name(self) -> str:
        """That of the port."""
        return self._port.name

    def arrived(self) -> list[tuple[float, bytes]]:
        """Bytes since the last call, each lot with its time. Raises DeviceFault once the port is gone."""
        chunks = self._chunks
        if not chunks:
            if self._fault is not None and not self._closing:
                raise self._fault
            return []
        return [chunks.popleft() for _ in range(len(chunks))]

    def read(self) -> bytes:
        """Everything that has arrived. Raises DeviceFault once the port is gone."""
        return b"".join(data for _, data in self.arrived())

    def write(self, data: bytes, timeout_s: float = 0.1) -> None:
        """Send all bytes within the time, else DeviceFault."""
        self._port.write(data, timeout_s)

    def wait_readable(self, timeout_s: float) -> bool:
        """Wait for bytes at most so long."""
        self._something.clear()
        return bool(self._chunks) or self._fault is not None or self._something.wait(max(timeout_s, 0.0))

    def close(self) -> None:
        """Stop listening and close; safe twice."""
        self._closing = True
        self._thread.join()
        self._port.close()


def arrivals(port: BytePort, clock: Callable[[], float]) -> list[tuple[float, bytes]]:
    """What has arrived at any port; without an ear of its own it arrives when it is asked for."""
    if isinstance(port, ListeningPort):
        return port.arrived()
    data = port.read()
    return [(clock(), data)] if data else []
