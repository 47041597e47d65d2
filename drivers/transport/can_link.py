"""The CAN side of an amplifier: sends and receives frames without a thread, and reports bus faults.

python-can reads through a background thread (``Notifier``) that dies of its first error; a control loop
that polls sees every error where it happens and needs no lock. While somebody waits here, ``idle`` is
called, so that other ports do not overflow meanwhile.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

import can

from drivers.codecs.lawicel import BIT_RATE_CODES, CanFrame
from drivers.transport.in_step import listening
from drivers.transport.ports import url_fault
from drivers.transport.slcan import SlcanBulkBus
from drivers.transport.socket_port import open_port
from rig.clock import HostClock, MonotonicClock
from rig.config.bench import CanConfig
from rig.errors import ConfigError, DeviceFault

POLL_INTERVAL_S = 0.0005  # half a tick of 1 kHz
MAX_FRAMES_A_POLL = 10_000  # frames: a babbling node must not hold the loop
SEND_TIMEOUT_S = 0.005  # five ticks of 1 kHz: an adapter that takes longer has stalled
MAX_ERRORS, ERRORS_WITHIN_S = 20, 0.1  # error frames, s: more is a fault of the bus; chosen, not derived
BUS_OFF = 0x40  # error class in the identifier of an error frame (linux/can/error.h: CAN_ERR_BUSOFF)
OWN_INTERFACE = "slcan_bulk"
OWN_URLS = {"etas": "ETAS://"}  # what an interface calls its own channels; pyserial has no part in it
CODE_OPTIONS = {"usb2can": ("dll",)}  # they name a library that python-can would load and run
NETWORK_INTERFACES = ("socketcand", "udp_multicast")  # they reach whatever machine the file names
OWN_OPTIONS = ("listen_only", "timestamps", "answer_timeout_s", "tty_baudrate")


class ReceivedFrame(NamedTuple):
    """A frame that arrived, with the host time at which it was read."""

    time_s: float
    frame: CanFrame


Record = Callable[[float, bool, CanFrame], None]
"""(time_s, was sent by us, frame): called for every frame that crosses the wire."""


class CanLink:
    """A bus as amplifier drivers see it.

    Parameters
    ----------
    bus
        An open python-can bus.
    clock
        Host time in seconds.
    pause
        Lets so many seconds of it pass; sleeps where left out.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Callable[[], float] = time.monotonic,
        pause: Callable[[float], None] | None = None,
    ) -> None:
        self._bus = bus
        # Elsewhere the identifier of an error frame means something else, or nothing.
        self._tells_error_class = type(bus).__module__.startswith("can.interfaces.socketcan")
        self.clock = clock
        self._pause = pause or MonotonicClock().pause
        # Our own bus sends a tick in one write and hands frames over without a message object each.
        own = bus if isinstance(bus, SlcanBulkBus) else None
        if own is not None:
            own.clock = clock
        self._lines = own.send_lines if own is not None else None
        self._take = own.take_frames if own is not None else None
        self.name = str(bus.channel_info)
        self._errors: deque[float] = deque()
        self.record: Record | None = None
        self.idle: Callable[[], None] = lambda: None
        self.listeners: list[Callable[[ReceivedFrame], None]] = []
        self.on_sent: Callable[[float, CanFrame], None] = lambda time_s, frame: None

    def send(self, frames: Sequence[CanFrame], urgent: bool = False) -> float:
        """Send all frames; the host time just before they were handed over.

        Before, because whoever hears them may already have acted when this thread runs again.

        Raises
        ------
        DeviceFault
            If the adapter refuses, stalls or is gone.
        """
        now_s = self.clock()
        try:
            if self._lines is not None:
                self._lines(frames, SEND_TIMEOUT_S, urgent)
            else:
                for frame in frames:
                    self._bus.send(_message(frame), SEND_TIMEOUT_S)
        except can.CanError as problem:
            raise DeviceFault(f"CAN on {self.name}: {problem}") from None
        for frame in frames:
            if self.record is not None:
                self.record(now_s, True, frame)
            self.on_sent(now_s, frame)
        return now_s

    def poll(self) -> list[ReceivedFrame]:
        """Frames that have arrived, handed to every listener too; never waits."""
        try:
            heard = [ReceivedFrame(*item) for item in self._take()] if self._take is not None else self._receive()
        except can.CanError as problem:
            raise DeviceFault(f"CAN on {self.name}: {problem}") from None
        for item in heard:
            if self.record is not None:
                self.record(item.time_s, False, item.frame)
            for listener in self.listeners:
                listener(item)
        return heard

    def _receive(self) -> list[ReceivedFrame]:
        heard: list[ReceivedFrame] = []
        while len(heard) < MAX_FRAMES_A_POLL:
            message = self._bus.recv(0)
            if message is None:
                break
            if message.is_error_frame:
                self._count_error(self.clock(), message.arbitration_id)
            else:
                heard.append(ReceivedFrame(self.clock(), _frame(message)))
        return heard

    def _count_error(self, now_s: float, error_class: int) -> None:
        """Error frames come one by one on a bus that is disturbed, and in hundreds on one that is about to go off."""
        if self._tells_error_class and error_class & BUS_OFF:
            raise DeviceFault(
                f"CAN on {self.name}: the adapter is off the bus (bus-off, after 256 transmit errors; limit 255) and "
                "sends nothing: check termination, bit rate and that another node acknowledges what is sent"
            )
        errors = self._errors
        errors.append(now_s)
        while errors[0] < now_s - ERRORS_WITHIN_S:
            errors.popleft()
        if len(errors) > MAX_ERRORS:
            raise DeviceFault(
                f"CAN on {self.name}: {len(errors)} error frames within {ERRORS_WITHIN_S:g} s (limit {MAX_ERRORS}): "
                "check termination, bit rate, shield and that another node acknowledges what is sent"
            )

    def fileno(self) -> int:
        """File descriptor on which arriving frames show, or -1 where the bus has none."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return -1

    def wait(self, timeout_s: float, until: Callable[[], bool], every: Callable[[], None] | None = None) -> bool:
        """Poll until the condition holds; False when the time is over. ``every`` runs between polls."""
        deadline = self.clock() + timeout_s
        while True:
            self.poll()
            if until():
                return True
            if self.clock() >= deadline:
                return False
            self.idle()
            if every is not None:
                every()
            self._pause(POLL_INTERVAL_S)

    def close(self) -> None:
        """Shut the bus down; safe twice."""
        self._bus.shutdown()


def _message(frame: CanFrame) -> can.Message:
    return can.Message(
        arbitration_id=frame.identifier,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        is_fd=frame.fd,
        bitrate_switch=frame.fd,
        data=None if frame.remote else frame.data,
        dlc=frame.length if frame.remote else None,
    )


def _frame(message: can.Message) -> CanFrame:
    return CanFrame(
        message.arbitration_id,
        bytes(message.data),
        message.is_extended_id,
        message.is_remote_frame,
        message.dlc,
        -1,
        message.is_fd,
    )


def bus_faults(config: CanConfig) -> Iterator[tuple[str, str]]:
    """What is wrong with a `can` section and known before its adapter is opened: the key below it, and why."""
    if config.interface != OWN_INTERFACE:
        known = sorted(can.VALID_INTERFACES | {OWN_INTERFACE})
        if config.interface not in known:
            near = get_close_matches(config.interface, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
            yield "interface", f"python-can has no interface {config.interface!r}; {hint}"
        yield from _unsafe_options(config)
        return
    yield from _unsafe_options(config)
    if config.bitrate not in BIT_RATE_CODES:
        allowed = ", ".join(str(rate) for rate in sorted(BIT_RATE_CODES))
        yield "bitrate", f"{config.bitrate} is not one of a Lawicel adapter's: {allowed}"
    for key in config.options:
        if key not in OWN_OPTIONS:
            yield f"options.{key}", f"unknown key; {OWN_INTERFACE} knows {', '.join(OWN_OPTIONS)}"


def _unsafe_options(config: CanConfig) -> Iterator[tuple[str, str]]:
    """What would let python-can write files, reach other machines or run code: the key, and why it is refused."""
    if config.interface in NETWORK_INTERFACES:
        yield "interface", f"{config.interface} is not allowed: it reaches other machines; name an adapter of this one"
    own = OWN_URLS.get(config.interface)
    fault = url_fault(config.channel.removeprefix(own) if own else config.channel) if config.channel else None
    if fault is not None:
        yield "channel", fault
    for key in CODE_OPTIONS.get(config.interface, ()):
        if key in config.options:
            yield f"options.{key}", f"is not allowed: {config.interface} would run the code in that file"


def open_bus(config: CanConfig, clock: HostClock | None = None) -> can.BusABC:
    """The bus that the configuration names; our own stamps frames by the clock and waits for answers on it.

    Raises
    ------
    ConfigError
        If python-can has no such interface, it does not take these options or the channel is a URL.
    DeviceFault
        If the adapter cannot be opened.
    """
    if config.channel is None:
        raise ConfigError(
            "bench.amplifier.can.channel is empty: name the adapter's port (`rig devices` lists them) "
            "or run with --emulate"
        )
    for key, fault in _unsafe_options(config):
        raise ConfigError(f"bench.amplifier.can.{key}: {fault}")
    options: dict[str, Any] = {"bitrate": config.bitrate, **config.options}
    try:
        if config.interface == OWN_INTERFACE:
            baud = options.pop("tty_baudrate", config.tty_baud)
            clock = clock or MonotonicClock()
            return SlcanBulkBus(listening(open_port(config.channel, baud), clock), clock=clock.now_s, **options)
        return can.Bus(channel=config.channel, interface=config.interface, **options)
    except can.CanInterfaceNotImplementedError as problem:
        raise ConfigError(f"bench.amplifier.can.interface: {config.interface!r}: {problem}") from None
    except (ValueError, TypeError) as problem:
        raise ConfigError(f"bench.amplifier.can: {problem}") from None
    except (can.CanError, OSError) as problem:
        raise DeviceFault(f"CAN adapter {config.interface} on {config.channel}: {problem}") from None
