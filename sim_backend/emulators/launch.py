"""Start the emulators in a process of their own, hand out their ports, and always stop them."""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rig.config.root import Config
from rig.errors import DeviceFault
from sim_backend.emulators.in_step.clock import InStepClock
from sim_backend.emulators.in_step.messages import Channel

START_TIMEOUT_S = 60.0  # the first start compiles the plant
STOP_TIMEOUT_S = 3.0  # then it is killed


@dataclass
class Emulators:
    """Running emulators: their ports and what their drive has done so far.

    A thread takes their events in as they come: a pipe that nobody reads would fill and stop them. ``clock`` is that
    of emulators in step: they stand still unless it is waited for; None where they run in real time.
    """

    gyro: str
    can: str
    process: subprocess.Popen[bytes]
    clock: InStepClock | None = None
    _lines: deque[bytes] = field(default_factory=deque)

    def __post_init__(self) -> None:
        threading.Thread(target=self._listen, name="events of the emulators", daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        rest = b""
        try:
            while part := os.read(self.process.stdout.fileno(), 65_536):
                *lines, rest = (rest + part).split(b"\n")
                self._lines.extend(lines)
        except (OSError, ValueError):  # closed while it was read
            return

    def events(self) -> list[dict[str, object]]:
        """Events since the last call, oldest first; never waits."""
        lines = self._lines
        return [json.loads(lines.popleft()) for _ in range(len(lines))]


def on_emulated_ports(config: Config, emulators: Emulators) -> Config:
    """The same configuration with the emulators' ports in the place of those in the file."""
    assert config.bench is not None
    gyroscope = config.bench.gyroscope.model_copy(update={"port": emulators.gyro})
    can = config.bench.amplifier.can.model_copy(
        update={"interface": "slcan_bulk", "channel": emulators.can, "options": {}}
    )
    amplifier = config.bench.amplifier.model_copy(update={"can": can})
    bench = config.bench.model_copy(update={"gyroscope": gyroscope, "amplifier": amplifier})
    return without_haste(config.model_copy(update={"bench": bench}))


def without_haste(config: Config) -> Config:
    """Without real-time priority where no tick can be late: what runs as fast as it can would starve the computer."""
    if config.bench is None or config.bench.emulator.clock != "in_step":
        return config
    real_time = config.bench.real_time.model_copy(update={"priority": 0, "lock_memory": False})
    return config.model_copy(update={"bench": config.bench.model_copy(update={"real_time": real_time})})


@contextmanager
def started(config: Config) -> Iterator[Emulators]:
    """Emulators of the devices in ``config.bench``; stopped on every way out.

    Raises
    ------
    DeviceFault
        If they do not come up, with what they said.
    """
    with _steps(config) as (ours, theirs):
        process = subprocess.Popen(
            [sys.executable, "-m", "sim_backend.emulators.process", *map(str, theirs)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C concerns the campaign: the drive stays there to be switched off
            pass_fds=theirs,
        )
        clock = InStepClock(Channel(ours)) if ours is not None else None
    try:
        yield _listening(process, config, clock)
    finally:
        if clock is not None:
            clock.close()
        _stop(process)


@contextmanager
def _steps(config: Config) -> Iterator[tuple[socket.socket | None, tuple[int, ...]]]:
    """Our end of the connection over which emulators in step let time pass, and the descriptor of theirs."""
    if config.bench is None or config.bench.emulator.clock != "in_step":
        yield None, ()
        return
    ours, theirs = socket.socketpair()
    with theirs:
        yield ours, (theirs.fileno(),)


def _listening(process: subprocess.Popen[bytes], config: Config, clock: InStepClock | None) -> Emulators:
    assert process.stdin is not None and process.stdout is not None and process.stderr is not None
    process.stdin.write(_on_sockets(without_haste(config)).model_dump_json().encode())
    process.stdin.close()
    deadline = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < deadline:
        if select.select([process.stdout], [], [], 0.1)[0]:
            line = process.stdout.readline()
            if line:
                ports = json.loads(line)
                return Emulators(ports["gyro"], ports["can"], process, clock)
            break
    process.kill()
    said = process.stderr.read().decode(errors="replace").strip()
    raise DeviceFault(f"the emulators did not start: {said[-2000:] or 'no message was received'}")


def _on_sockets(config: Config) -> Config:
    """Nobody but this program opens these ports: sockets do, unless the file wants terminals."""
    if config.bench is None or config.bench.emulator.ports is not None:
        return config
    emulator = config.bench.emulator.model_copy(update={"ports": "socket"})
    return config.model_copy(update={"bench": config.bench.model_copy(update={"emulator": emulator})})


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()
