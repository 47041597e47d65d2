"""The emulators' own process: ``python -m sim_backend.emulators.process`` with a configuration on stdin.

A number behind it is the descriptor on which a bench lets time pass, for emulators in step with it.
"""

from __future__ import annotations

import json
import select
import signal
import socket
import sys
import time
from collections.abc import Callable
from types import FrameType

from rig import realtime
from rig.config.root import Config
from rig.errors import ConfigError, RigError
from sim_backend.emulators.bench import EmulatedBench
from sim_backend.emulators.device import Event
from sim_backend.emulators.faults.requests import FaultRequests
from sim_backend.emulators.in_step.messages import Channel
from sim_backend.emulators.in_step.stepper import Stepper

PRIORITY_ABOVE_THE_LOOP = 5
LOOK_FOR_LISTENER_S = 0.2


def _say(line: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


def _refused(why: str) -> None:
    _say({"event": "refused", "detail": why})


def listener_is_gone() -> Callable[[], bool]:
    """A function that says, a few times a second, whether the reader of standard output has gone away.

    A program that was killed stops nothing; its emulated devices must not outlive it because they had nothing to say.
    """
    poll = select.poll()
    try:
        poll.register(sys.stdout.fileno(), 0)
    except (OSError, ValueError):
        return lambda: False
    due_s = 0.0

    def gone() -> bool:
        nonlocal due_s
        now_s = time.monotonic()
        if now_s < due_s:
            return False
        due_s = now_s + LOOK_FOR_LISTENER_S
        return any(happened & (select.POLLERR | select.POLLHUP | select.POLLNVAL) for _, happened in poll.poll(0))

    return gone


def run_emulators(config: Config, requests: int | None = None, steps: Channel | None = None) -> None:
    """Emulate the devices of the configuration's `bench` section until SIGINT or SIGTERM.

    Prints one JSON line with the ports, then one for each event of the drive. ``requests`` is a descriptor
    on which faults are asked for, one JSON line each; ``steps`` is where a bench lets time pass.

    Raises
    ------
    ConfigError
        If there is no such section, a device without emulator, or no bench to be in step with.
    """
    stopping = False

    def stop(_signal: int, _frame: FrameType | None) -> None:
        nonlocal stopping
        stopping = True

    def tell(event: Event) -> None:
        nonlocal stopping
        try:
            _say(event.as_json())
        except OSError:
            stopping = True  # nobody listens any more

    _require_bench_in_step(config, steps)
    stepper = Stepper(config, tell, steps) if steps is not None else None
    bench = stepper.bench if stepper is not None else EmulatedBench(config, tell)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    assert config.bench is not None
    priority = config.bench.real_time.priority
    realtime.acquire(
        priority + PRIORITY_ABOVE_THE_LOOP if priority else 0, lock_memory=config.bench.real_time.lock_memory
    )
    try:
        _say({"event": "listening", "gyro": bench.gyro_port.path, "can": bench.can_port.path})
        faults = FaultRequests(requests, bench.inject, _refused) if requests is not None else None

        gone = listener_is_gone()

        def stop_asked() -> bool:
            if faults is not None:
                faults.poll()
            return stopping or gone()

        (stepper or bench).run(stop_asked)
    finally:
        bench.close()
        realtime.release()


def _require_bench_in_step(config: Config, steps: Channel | None) -> None:
    if config.bench is not None and config.bench.emulator.clock == "in_step" and steps is None:
        raise ConfigError(
            "bench.emulator.clock is in_step: that needs a bench that lets time pass, as `identify-run --emulate` has. "
            "Add --set bench.emulator.clock=real to emulate the devices for other programs."
        )


def main() -> int:
    """Read the configuration as JSON from stdin and emulate; errors go to stderr as plain text."""
    steps = Channel(socket.socket(fileno=int(sys.argv[1]))) if len(sys.argv) > 1 else None
    try:
        run_emulators(Config.model_validate_json(sys.stdin.read()), steps=steps)
    except RigError as problem:
        sys.stderr.write(f"{problem}\n")
        return problem.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
