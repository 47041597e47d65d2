"""The emulators' side of a bench in step: devices and platform advance when the bench asks, event by event.

Time stands still between two requests. A bench that is gone, or that asks for nothing while there is torque for
longer than any computer stalls, would leave it on for ever; so then time goes on by itself until the drive's own
watchdog has cut the torque.
"""

from __future__ import annotations

import contextlib
import select
import time
from collections.abc import Callable

from rig.clock import VirtualClock
from rig.config.root import Config
from rig.errors import DeviceFault
from sim_backend.emulators.bench import EmulatedBench
from sim_backend.emulators.device import SETTLED_ZERO_S, Event
from sim_backend.emulators.in_step.messages import PATIENCE_S, START_S, Channel, Reply, Request, Written
from sim_backend.emulators.in_step.port import SteppedSocket

LOOK_S = 0.05  # s of the computer between two looks at whether to stop
LONGEST_REST_S = 0.002  # s between two looks at the drive's timers where the gyro is slower, as in real time
# s from the host to a device. Drives stamp by ticks of 1 us: one that took a set point in the very instant at which it
# was sent would say that it had acted before, and the host fits its clock by what it says.
TRANSIT_S = 1e-6
LONGEST_WATCHDOG_S = 6.0  # s: bench.amplifier.watchdog_ms is 5 s at most


class Stepper:
    """An emulated bench in a time that its host lets pass.

    Parameters
    ----------
    config
        A whole configuration with a `bench` section, its emulator on sockets.
    on_event
        Called with every event of the drive.
    channel
        The connection to the bench.
    patience_s
        How long, in seconds of the computer, a bench may be silent while there is torque.
    """

    def __init__(
        self, config: Config, on_event: Callable[[Event], None], channel: Channel, patience_s: float = PATIENCE_S
    ) -> None:
        self._time = VirtualClock(START_S)
        self._ports: dict[str, SteppedSocket] = {}
        self.bench = EmulatedBench(config, on_event, self._time.now_s, self._new_port)
        self._channel, self._patience_s = channel, patience_s

    def _new_port(self) -> SteppedSocket:
        port = SteppedSocket(self._time.now_s)
        self._ports[port.path] = port
        return port

    def run(self, stop: Callable[[], bool]) -> None:
        """Emulate until ``stop()``, asked at least every ``LOOK_S`` of the computer, or until the bench is gone."""
        silent_since_s = time.monotonic()
        while not stop():
            try:
                request = self._channel.request(LOOK_S)
            except TimeoutError:
                if self.bench.drive.torque_nm and time.monotonic() - silent_since_s > self._patience_s:
                    self._let_go()
                continue
            if request is None:
                break
            with contextlib.suppress(OSError):  # gone meanwhile: the next look says so
                self._channel.send(self._advanced(request))
            silent_since_s = time.monotonic()
        self._take_in_all()
        self._let_go()

    def _advanced(self, request: Request) -> Reply:
        if any(self._is_under_way(name, written) for name, written in request.written.items()):
            self._pass_to(self._time.now_s() + TRANSIT_S)
            self._take_in(request)
        self._pass_to(request.until_s)
        sent = {name: port.hand_over() for name, port in self._ports.items()}
        return Reply(request.number, self._time.now_s(), sent)

    def _pass_to(self, until_s: float) -> None:
        """Event by event."""
        while (now_s := self._time.now_s()) < until_s:
            self._time.wait_until(min(self.bench.next_sample_s(), now_s + LONGEST_REST_S, until_s))
            self.bench.pass_time()

    def _is_under_way(self, name: str, written: Written) -> bool:
        port = self._ports[name]
        return port.plugged_in and (port.openings, port.received_bytes) < written

    def _take_in(self, request: Request) -> None:
        """What the bench has written by now takes effect now. Raises DeviceFault where it does not come through."""
        for name, written in request.written.items():
            port = self._ports[name]
            while self._is_under_way(name, written):
                if not select.select([port], [], [], self._patience_s)[0]:
                    raise DeviceFault(f"{name}: {written.written_bytes} bytes were sent, {port.received_bytes} came")
                self.bench.pass_time([port])

    def _take_in_all(self) -> None:
        """Whatever the bench had still written before it went."""
        while ready := select.select([port for port in self._ports.values() if port.plugged_in], [], [], 0.0)[0]:
            self.bench.pass_time(ready)

    def _let_go(self) -> None:
        """Time goes on by itself until there is no torque any more, and that has been told."""
        end_s = self._time.now_s() + LONGEST_WATCHDOG_S
        while self.bench.drive.torque_nm and self._time.now_s() < end_s:
            self._pass_to(self._time.now_s() + LONGEST_REST_S)
        self._pass_to(self._time.now_s() + 2.0 * SETTLED_ZERO_S)
