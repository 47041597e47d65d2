"""The process that serves the live page: it reads the journal from the disk and never touches the control loop.

The fits are made in a further process of the lowest priority: neither the loop nor the stop button waits for a fit.
It speaks with the campaign's process over its standard streams, one JSON object a line: in come the planned sets, the
limits, the path of the journal and what the identification says; out go the address of the page and the stop button.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import secrets
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from typing import Any

from commands.live.fit import fit_worker
from commands.live.state import LiveState
from rig.recording.following import JournalFollower

JOURNAL_CHECK_S = 0.1  # between two looks at the journal
SWITCH_S = 5e-4  # between threads: the stop button waits for none of the others (Python's default is 5 ms)
LINGER_S = 3.0  # after the campaign: the page fetches the last state
HOST = "127.0.0.1"


class LiveProcess:
    """State, journal and fits, each in the thread that feeds it, behind one lock."""

    def __init__(self, say: Callable[[Mapping[str, Any]], None]) -> None:
        self.state, self.lock = LiveState(), threading.Lock()
        self._say = say
        self._follower: JournalFollower | None = None
        self._terms: tuple[str, ...] = ("inertia", "damping", "stiffness")
        self._news = threading.Event()

    def hear(self, line: str) -> None:
        """One line of the campaign's process."""
        said = json.loads(line)
        with self.lock:
            self.state.tell(said)
            if "journal" in said:
                self._follower, self._terms = JournalFollower(Path(said["journal"])), tuple(said["terms"])

    def follow(self) -> None:
        """Read the journal for ever."""
        while True:
            with self.lock, contextlib.suppress(OSError):
                known = len(self.state.complete)
                for frame in self._follower.new_frames() if self._follower else ():
                    self.state.take(*frame)
                if len(self.state.complete) > known:
                    self._news.set()
            time.sleep(JOURNAL_CHECK_S)

    def fit(self) -> None:
        """Have the sets fitted whenever a further one is complete, for ever."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        context.Process(target=fit_worker, args=(theirs,), daemon=True).start()
        theirs.close()
        with contextlib.suppress(EOFError, OSError):  # without its process there are no further rows
            while True:
                self._news.wait()
                self._news.clear()
                with self.lock:
                    complete, terms = list(self.state.complete), self._terms
                ours.send((complete, terms))
                row = ours.recv()
                if row is not None:  # sets that determine nothing yet have none
                    with self.lock:
                        self.state.fits = [*self.state.fits, row]

    def stop(self) -> None:
        """The stop button."""
        self._say({"stop": True})
        with self.lock:
            self.state.stop_asked = True

    def snapshot(self) -> bytes:
        """The state as JSON."""
        with self.lock:
            return json.dumps(self.state.snapshot(), allow_nan=False).encode()


def handler_of(process: LiveProcess, token: str) -> type[BaseHTTPRequestHandler]:
    """The answers of the server; without the token everything is refused."""
    page = (files("commands.live") / "page.html").read_text(encoding="utf-8")

    class Handler(BaseHTTPRequestHandler):
        server: ThreadingHTTPServer
        protocol_version = "HTTP/1.1"  # the stop button finds a connection open
        disable_nagle_algorithm = True

        def do_GET(self) -> None:
            if not self._is_ours():
                return
            if self.path == f"/{token}/":
                nonce = secrets.token_urlsafe(16)
                policy = (
                    f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; "
                    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
                )
                self._answer(page.replace("NONCE", nonce).encode(), "text/html; charset=utf-8", policy)
            elif self.path == f"/{token}/state":
                self._answer(process.snapshot(), "application/json")
            else:
                self.send_error(404)

        def do_POST(self) -> None:
            if not self._is_ours():
                return
            # A header that no form of another site can send, beside the token in the address.
            if self.path == f"/{token}/stop" and secrets.compare_digest(self.headers.get("X-Token", ""), token):
                process.stop()
                self._answer(b"{}", "application/json")
            else:
                self.send_error(403)

        def _is_ours(self) -> bool:
            """By name and by token: a page elsewhere whose name was pointed here has another Host."""
            port = self.server.server_port
            host_is_ours = self.headers.get("Host", "") in (f"{HOST}:{port}", f"localhost:{port}")
            parts = self.path.split("/")
            if host_is_ours and len(parts) > 1 and secrets.compare_digest(parts[1].encode(), token.encode()):
                return True
            self.send_error(403)
            return False

        def _answer(self, body: bytes, kind: str, policy: str = "default-src 'none'") -> None:
            self.send_response(200)
            for name, value in (
                ("Content-Type", kind), ("Content-Length", str(len(body))), ("Cache-Control", "no-store"),
                ("Content-Security-Policy", policy), ("Referrer-Policy", "no-referrer"),
                ("X-Content-Type-Options", "nosniff"),
            ):  # fmt: skip
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Nothing: standard error belongs to the campaign."""

    return Handler


def main() -> None:
    """Serve until the campaign's process closes its end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the campaign, which this page goes on to show
    sys.setswitchinterval(SWITCH_S)
    write = threading.Lock()

    def say(what: Mapping[str, Any]) -> None:
        with write, contextlib.suppress(OSError):
            sys.stdout.write(json.dumps(what) + "\n")
            sys.stdout.flush()

    process, token = LiveProcess(say), secrets.token_urlsafe(24)
    server = ThreadingHTTPServer((HOST, 0), handler_of(process, token))
    server.daemon_threads = True
    for work in (server.serve_forever, process.follow, process.fit):
        threading.Thread(target=work, daemon=True).start()
    say({"url": f"http://{HOST}:{server.server_address[1]}/{token}/"})
    for line in sys.stdin:
        process.hear(line)
    time.sleep(LINGER_S)


if __name__ == "__main__":
    main()
