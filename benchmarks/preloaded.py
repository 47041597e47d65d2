"""Processes that start at once: a parent that has everything loaded forks them.

A command of `rig` takes seconds to load on a busy machine, and a table of faults starts four hundred. The parent has
one thread, reads requests as JSON lines and answers each with one:

    {"program": "host", "argv": [...], "stdin": path, "stdout": path, "stderr": path}  ->  {"pid": 123}
    {"poll": 123}                                                                      ->  {"code": null}
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

monotonic = time.monotonic
jumped = [0.0]  # what a child's clock is ahead by
JUMP_S, HANG_S = 0.2, 1.5


class Started:
    """One of them, with the methods of ``subprocess.Popen`` that are needed here."""

    def __init__(self, parent: Parent, pid: int) -> None:
        self._parent, self.pid = parent, pid
        self._code: int | None = None

    def poll(self) -> int | None:
        """Its exit code, negative for a signal; None while it runs."""
        if self._code is None:
            self._code = self._parent.ask({"poll": self.pid})["code"]
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end. Raises subprocess.TimeoutExpired."""
        end_s = monotonic() + (1e9 if timeout is None else timeout)
        while (code := self.poll()) is None:
            if monotonic() > end_s:
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
            time.sleep(0.01)
        return code

    def _send(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """SIGTERM."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """SIGKILL."""
        self._send(signal.SIGKILL)


class Parent:
    """The process that forks; one for all threads of a benchmark."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.preloaded"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._turn = threading.Lock()

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """One request and its answer."""
        with self._turn:
            assert self._process.stdin is not None and self._process.stdout is not None
            self._process.stdin.write((json.dumps(request) + "\n").encode())
            self._process.stdin.flush()
            answer: dict[str, Any] = json.loads(self._process.stdout.readline())
            return answer

    def start(self, program: str, argv: Sequence[str], stdin: str, stdout: str, stderr: str) -> Started:
        """Fork one: "host" is `rig` with three ways to fail on a signal, "rig" is `rig`."""
        streams = {"stdin": stdin, "stdout": stdout, "stderr": stderr}
        return Started(self, self.ask({"program": program, "argv": list(argv), **streams})["pid"])


_parent: list[Parent] = []
_making = threading.Lock()


def parent() -> Parent:
    """The one of this process, started when it is first wanted."""
    with _making:
        if not _parent:
            _parent.append(Parent())
        return _parent[0]


# -- in the parent, and in what it forks ---------------------------------------------------------------------


def _hang(number: int, frame: object) -> None:
    end_s = monotonic() + HANG_S
    while monotonic() < end_s:
        time.sleep(0.01)


def _fail(number: int, frame: object) -> None:
    raise RuntimeError("something that nobody foresaw")


def _jump(number: int, frame: object) -> None:
    jumped[0] = JUMP_S


def _as_host() -> None:
    handlers: dict[int, Callable[[int, object], None]] = {
        signal.SIGUSR1: _hang, signal.SIGUSR2: _fail, signal.SIGALRM: _jump,
    }  # fmt: skip
    for number, handler in handlers.items():
        signal.signal(number, handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever started this may have had it ignored


def _child(request: dict[str, Any]) -> int:
    os.setsid()
    for number, name, flags in ((0, "stdin", os.O_RDWR), (1, "stdout", os.O_RDWR), (2, "stderr", os.O_RDWR)):
        descriptor = os.open(request[name], flags | os.O_CREAT, 0o644)
        os.dup2(descriptor, number)
        os.close(descriptor)
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(k, mode) for k, mode in ((0, "r"), (1, "w"), (2, "w")))
    sys.argv = ["rig", *request["argv"]]
    if request["program"] == "host":
        _as_host()
    from commands.rig import main as rig  # noqa: PLC0415  loaded already

    try:
        rig()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    return 0


def _load() -> None:
    """Everything that a command needs, compiled functions included."""
    time.monotonic = lambda: monotonic() + jumped[0]
    import commands.rig.app  # noqa: PLC0415
    import commands.rig.play  # noqa: F401, PLC0415
    from rig.config.load import load_config  # noqa: PLC0415
    from rig.preflight import plan  # noqa: PLC0415
    from sim_backend.emulators.bench import EmulatedBench  # noqa: PLC0415

    config = load_config("examples/bench.yaml").config
    EmulatedBench(config, lambda event: None).close()
    plan(config.model.platform(), config.excitation, config.limits)


def main() -> None:
    """Serve until standard input ends."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    _load()
    codes: dict[int, int] = {}
    for line in sys.stdin:
        request = json.loads(line)
        while codes is not None:
            try:
                ended, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                break
            if not ended:
                break
            codes[ended] = os.waitstatus_to_exitcode(status)
        if "poll" in request:
            answer: dict[str, Any] = {"code": codes.get(request["poll"])}
        else:
            pid = os.fork()
            if not pid:
                code = 70
                try:
                    code = _child(request)
                finally:
                    for stream in (sys.stdout, sys.stderr):
                        try:
                            stream.flush()
                        except (OSError, ValueError):
                            continue
                    os._exit(code)
            answer = {"pid": pid}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
