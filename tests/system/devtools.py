"""A headless Chromium over its DevTools pipe: no port, no driver, a profile of its own."""

from __future__ import annotations

import fcntl
import json
import os
import select
import shutil
import signal
import time
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",  # Chromium refuses to run as root with it
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--remote-debugging-pipe",
    "--window-size=1200,900",
)
FROM_US, TO_US = 3, 4  # the two ends that Chromium expects


def find_chromium() -> str | None:
    """Path of an installed Chromium, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def axe_script() -> str:
    """The source of axe-core, which checks what a screen reader and low contrast would stumble over."""
    return (files("axe_core_python") / "axe.min.js").read_text(encoding="utf-8")


class Browser:
    """One page. ``events`` holds everything the page reported, in order."""

    def __init__(self, executable: str, profile: Path, patience_s: float = 60.0) -> None:
        self.events: list[dict[str, Any]] = []
        self._patience_s = patience_s  # for each answer: how long all of them take is the machine's
        self._number, self._received, self._session = 0, b"", ""
        theirs_in, self._to = _far_pipe()
        self._from, theirs_out = _far_pipe()
        arguments = [executable, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        null = os.open(os.devnull, os.O_RDWR)
        actions = [(os.POSIX_SPAWN_DUP2, null, fd) for fd in (0, 1, 2)]
        actions += [(os.POSIX_SPAWN_DUP2, theirs_in, FROM_US), (os.POSIX_SPAWN_DUP2, theirs_out, TO_US)]
        self._pid = os.posix_spawn(executable, arguments, os.environ, file_actions=actions)
        for fd in (null, theirs_in, theirs_out):
            os.close(fd)

    def open(self, url: str, width_px: int | None = None, features: Sequence[dict[str, str]] = ()) -> None:
        """Open ``url`` in a page of its own, watching console, exceptions and requests from the first byte on.

        ``width_px`` is that of a phone's window; ``features`` are media features, as of the colour scheme.
        """
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")
        if width_px is not None:
            size = {"width": width_px, "height": 844, "deviceScaleFactor": 1}
            self.call("Emulation.setDeviceMetricsOverride", mobile=True, **size)
        if features:
            self.call("Emulation.setEmulatedMedia", features=list(features))
        self.call("Page.navigate", url=url)
        while not self.of_kind("Page.loadEventFired"):
            self.events.append(self._next())

    def leave(self) -> None:
        """Close the page and forget what it reported, for another to be opened."""
        if self._session:
            self.call("Page.close")
        self._session = ""
        self.events.clear()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command and its answer; events that come in between are kept."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return dict(answer["result"])
            self.events.append(answer)

    def evaluate(self, script: str) -> Any:
        """Value of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, script: str) -> Any:
        """Value of the expression as soon as it is true."""
        look = f"const look = () => {{ const v = {script}; v ? done(v) : setTimeout(look, 50) }}; look()"
        return self.evaluate(f"new Promise(done => {{ {look} }})")

    def of_kind(self, *methods: str) -> list[dict[str, Any]]:
        """Parameters of the events of some kinds."""
        return [event["params"] for event in self.events if event.get("method") in methods]

    def close(self) -> None:
        """End the browser that was started here."""
        os.close(self._to)  # Chromium ends when its pipe does
        os.close(self._from)
        for _ in range(100):
            if os.waitpid(self._pid, os.WNOHANG)[0]:
                return
            time.sleep(0.05)
        os.kill(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._received:
            ready = select.select([self._from], [], [], self._patience_s)[0]
            assert ready, "Chromium did not answer in time"
            chunk = os.read(self._from, 1 << 20)
            assert chunk, "Chromium ended"
            self._received += chunk
        message, _, self._received = self._received.partition(b"\0")
        return dict(json.loads(message))


def _far_pipe() -> tuple[int, int]:
    """A pipe whose descriptors do not stand where Chromium's have to be."""
    near = os.pipe()
    far = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 10) for fd in near]
    for fd in near:
        os.close(fd)
    return far[0], far[1]
