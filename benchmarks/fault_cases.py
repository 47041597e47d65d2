"""The faults of the table: what is done, what has to come of it, and how soon it has to be seen."""

from __future__ import annotations

import os
import re
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from benchmarks.emulated import Devices, Host, interrupt_twice
from benchmarks.preloaded import JUMP_S

DISK_FULL_BYTES = 4096  # whatever stands further back in a file cannot be written any more
SAID = 110
LATER = 10.0  # nothing is wrong yet: samples or frames are missing, and it plays on as long as that does no harm


class Road(Enum):
    """What takes the torque off."""

    WORKS = "the host, over a command path that works"
    DEAD = "the drive's watchdog, because the command path or the host is dead"
    DRIVE = "the drive, of itself"


Strike = Callable[[Devices, Host | None], float]


@dataclass
class Case:
    """One fault. ``strike`` does it and returns the moment; ``detected_s`` is how soon the host has to know.

    ``before`` is done before the host is started, which then must not get as far as torque.
    """

    name: str
    strike: Strike
    codes: frozenset[int]
    path: Road = Road.WORKS
    detected_s: float = 0.05
    before: bool = False
    host_dies: bool = False
    devices: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()
    has_terminal: bool = False
    ahead_s: float = 0.0  # the host's clock, once it has jumped
    _terminals: list[int] = field(default_factory=list)

    def terminal(self) -> str | None:
        """A terminal for the host, where it is to lose one."""
        if not self.has_terminal:
            return None
        import pty  # noqa: PLC0415  POSIX only

        master, slave = pty.openpty()
        os.set_blocking(master, False)
        self._terminals += [master, slave]
        return os.ttyname(slave)

    def quote(self, said: str) -> str:
        """The sentence that matters of all that was said."""
        found = re.search(r"(Device fault|Safety trip|Stopped|Internal error|Error)[^:]{0,40}:.*", said)
        text = found.group(0) if found else ""
        text = re.sub(r"/dev/pts/\d+|(unix:)?/tmp/\S+", "...", text)
        return text if len(text) <= SAID else text[:SAID].rsplit(" ", 1)[0] + " ..."


def injected(fault: str, **more: object) -> Strike:
    """A fault of the emulators."""

    def strike(devices: Devices, host: Host | None) -> float:
        asked_s = time.monotonic()
        devices.inject(fault=fault, **more)
        end_s = asked_s + 1.0
        while time.monotonic() < end_s:
            told = [e for e in devices.events if e["event"] == "injected" and e["time_s"] >= asked_s - 1e-3]
            if told:
                return float(told[0]["time_s"])
            time.sleep(0.002)
        return asked_s

    return strike


def signals(*numbers: int) -> Strike:
    """Sent to the host."""
    return lambda devices, host: host.send(*numbers) if host is not None else time.monotonic()


def stopped(seconds: float) -> Strike:
    """The host is stopped for so long."""

    def strike(devices: Devices, host: Host | None) -> float:
        assert host is not None
        at_s = host.send(signal.SIGSTOP)
        time.sleep(seconds)
        host.send(signal.SIGCONT)
        return at_s

    return strike


def twice(devices: Devices, host: Host | None) -> float:
    """Ctrl-C, and again."""
    assert host is not None
    return interrupt_twice(host)


def disk_full(devices: Devices, host: Host | None) -> float:
    """The system refuses every further write."""
    assert host is not None
    at_s = time.monotonic()
    resource.prlimit(host.process.pid, resource.RLIMIT_FSIZE, (DISK_FULL_BYTES, DISK_FULL_BYTES))
    return at_s


def nothing(devices: Devices, host: Host | None) -> float:
    """Nothing is done: it is the configuration that is wrong."""
    return time.monotonic()


def of_emulators(name: str, codes: set[int], detected_s: float = 0.05, path: Road = Road.WORKS, **more: Any) -> Case:
    """A fault of the emulators in the middle of a set."""
    return Case(name, injected(name, **more), frozenset(codes), path, detected_s)


def at_start(name: str, fault: str, codes: set[int], path: Road = Road.DEAD, **more: Any) -> Case:
    """A fault that is there from the beginning."""
    return Case(name, injected(fault, **more), frozenset(codes), path, before=True)


def of_host(name: str, strike: Strike, codes: set[int], detected_s: float = 0.05, path: Road = Road.WORKS) -> Case:
    """Something that is done to the host."""
    return Case(name, strike, frozenset(codes), path, detected_s, host_dies=path is Road.DEAD)


def _terminal_closed(devices: Devices, host: Host | None) -> float:
    at_s = time.monotonic()
    while TERMINAL_CLOSED._terminals:
        os.close(TERMINAL_CLOSED._terminals.pop(0))
    return at_s


TERMINAL_CLOSED = Case("terminal_closed", _terminal_closed, frozenset({130}), detected_s=0.25, has_terminal=True)

CASES: tuple[Case, ...] = (
    of_emulators("gyro_unplugged", {3, 4}),
    of_emulators("gyro_replugged", {3, 4}, lasts_s=0.3),
    of_emulators("gyro_silent", {4}),
    of_emulators("gyro_checksum", {4}),
    of_emulators("gyro_garbled", {4}),
    of_emulators("gyro_flagged", {4}),
    of_emulators("gyro_restarts", {4}),
    of_emulators("gyro_dropped", {0, 4}, LATER),
    of_emulators("gyro_repeated", {0}),
    of_emulators("gyro_merged", {0, 4}, LATER),
    of_emulators("gyro_delayed", {4}, 0.08),
    of_emulators("gyro_stuck", {4}, 0.15),
    of_emulators("gyro_reversed", {4}, 1.0),
    of_emulators("gyro_loose", {4}, 0.5),
    of_emulators("gyro_jump", {4}),
    Case("gyro_jump of 3 rad/s", injected("gyro_jump", value=3.0), frozenset({4}), detected_s=0.2),
    of_emulators("gyro_noisy", {4}, 0.1),
    of_emulators("gyro_spikes", {4}, 1.0),
    of_emulators("gyro_drifts", {4}, 1.5),
    of_emulators("gyro_saturated", {4}),
    of_emulators("adapter_unplugged", {3}, path=Road.DEAD),
    of_emulators("adapter_replugged", {3}, path=Road.DEAD, lasts_s=0.3),
    of_emulators("both_unplugged", {3, 4}, path=Road.DEAD),
    of_emulators("adapter_stalls", {3}, path=Road.DEAD),
    of_emulators("adapter_garbled", {3}, path=Road.DEAD),
    of_emulators("adapter_slow", {3}, path=Road.DEAD),
    of_emulators("adapter_drops", {0, 3}, LATER),
    of_emulators("bus_off", {3}, path=Road.DEAD),
    of_emulators("bus_deaf", {3}, 0.21),
    of_emulators("host_beat_lost", {3, 4}, path=Road.DRIVE),
    of_emulators("drive_beat_lost", {3}, 0.21),
    of_emulators("drive_fault", {3, 4}, path=Road.DRIVE),
    of_emulators("drive_emergency", {3}),
    of_emulators("drive_reset", {3, 4}, path=Road.DRIVE),
    of_emulators("drive_stopped", {3, 4}, path=Road.DRIVE),
    of_emulators("drive_pre_operational", {3, 4}, path=Road.DRIVE),
    of_emulators("drive_off", {3, 4}, path=Road.DRIVE),
    of_emulators("torque_runs_away", {4}, 0.2),
    of_emulators("torque_reversed", {4}, 0.5),
    of_emulators("torque_doubled", {4}, 0.8),
    of_emulators("torque_dead", {4}, 1.5),
    of_emulators("torque_stuck", {4}, 1.5),
    of_emulators("torque_saturates", {0, 4}, LATER),
    of_host("kill -9", signals(signal.SIGKILL), {-signal.SIGKILL}, path=Road.DEAD),
    of_host("SIGSTOP for a second", stopped(1.0), {4}, path=Road.DEAD),
    of_host("SIGSTOP for 60 ms", stopped(0.06), {4}, 0.1),
    of_host("loop hangs, threads alive", signals(signal.SIGUSR1), {3, 4}, path=Road.DEAD),
    of_host("exception in the loop", signals(signal.SIGUSR2), {70}),
    Case("clock jumps by 200 ms", signals(signal.SIGALRM), frozenset({4}), ahead_s=JUMP_S),
    of_host("Ctrl-C", signals(signal.SIGINT), {130}),
    of_host("Ctrl-C twice", twice, {130}),
    of_host("SIGTERM", signals(signal.SIGTERM), {130}),
    of_host("SIGHUP", signals(signal.SIGHUP), {130}),
    TERMINAL_CLOSED,
    of_host("disk full", disk_full, {130}, 0.2),
    Case("wrong node number", nothing, frozenset({3}), Road.DEAD, before=True, overrides=("bench.amplifier.node=2",)),
    Case("wrong CAN bit rate (bus silent)", injected("adapter_stalls"), frozenset({3}), Road.DEAD, before=True),
    at_start("gyro at another baud rate", "gyro_garbled", {3}),
    at_start("adapter at another baud rate", "adapter_garbled", {3}),
    at_start("gyro silent at the start", "gyro_silent", {3}),
    at_start("gyro the wrong way round", "gyro_reversed", {4}, Road.WORKS),
    at_start("motor the wrong way round", "torque_reversed", {4}, Road.WORKS),
    at_start("gyro off its shaft", "gyro_loose", {4}, Road.WORKS),
    at_start("gyro of another scale", "gyro_scaled", {4}, Road.WORKS),
)
