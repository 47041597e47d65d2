"""The campaign's end of the live view: starts the process that serves the page and hears the stop button."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

from rig.errors import UsageError

START_WITHIN_S = 20.0  # a cold start reads NumPy from a slow disk
STOP_REASON = "Stopped from the live page"


class NoLiveView:
    """Where nobody asked for one."""

    def plays(
        self, sets: Sequence[tuple[str, float]], limits: Mapping[str, float], journal: Path, terms: Sequence[str]
    ) -> None:
        """A part of a campaign begins: names and durations (s) of its sets, limits, and the journal it writes."""

    def note(self, text: str) -> None:
        """What the identification is doing."""

    def finished(self, text: str, report: Path | None = None) -> None:
        """How it ended, and where the report is, if there is one."""


class LiveView(NoLiveView):
    """Lines to the page's process. None of them waits: a thread writes."""

    def __init__(self, pipe: IO[str]) -> None:
        self._pipe = pipe
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._write, name="live view", daemon=True)
        self._thread.start()

    def _write(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # the process is gone: the campaign goes on without it
            while (line := self._lines.get()) is not None:
                self._pipe.write(line)
                self._pipe.flush()
        with contextlib.suppress(OSError):
            self._pipe.close()

    def _tell(self, what: Mapping[str, Any]) -> None:
        self._lines.put(json.dumps(what) + "\n")

    def plays(
        self, sets: Sequence[tuple[str, float]], limits: Mapping[str, float], journal: Path, terms: Sequence[str]
    ) -> None:
        """As above."""
        planned = [{"name": name, "duration_s": duration_s} for name, duration_s in sets]
        where = str(journal.resolve())
        self._tell({"sets": planned, "limits": dict(limits), "journal": where, "terms": list(terms)})

    def note(self, text: str) -> None:
        """As above."""
        self._tell({"note": text})

    def finished(self, text: str, report: Path | None = None) -> None:
        """As above."""
        self._tell({"result": text, "report": "" if report is None else str(report)})

    def close(self) -> None:
        """Write what waits and let the page's process end by itself."""
        self._lines.put(None)
        self._thread.join(1.0)


@contextmanager
def live_view(request_stop: Callable[[str], None], announce: Callable[[str], None]) -> Iterator[LiveView]:
    """The page while a campaign plays; its address is announced.

    ``request_stop`` is called from a thread when the stop button was pressed. Raises UsageError where the page cannot
    be served.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "commands.live.server"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True, encoding="utf-8",
    )  # fmt: skip
    assert process.stdin is not None and process.stdout is not None
    answered = threading.Event()
    heard: list[str] = []

    def listen(lines: IO[str]) -> None:
        with contextlib.suppress(OSError, ValueError), lines:
            for line in lines:
                said = json.loads(line)
                if said.get("stop"):
                    request_stop(STOP_REASON)
                elif "url" in said:
                    heard.append(said["url"])
                    answered.set()
        answered.set()

    threading.Thread(target=listen, args=(process.stdout,), name="stop button", daemon=True).start()
    view = LiveView(process.stdin)
    try:
        answered.wait(START_WITHIN_S)
        if not heard:
            process.kill()
            raise UsageError("--live: the page could not be served on 127.0.0.1: leave --live out")
        announce(f"live view: {heard[0]}")
        yield view
    finally:
        view.close()
        # It ends by itself once its page had the last state; nobody has to wait for that.
        threading.Thread(target=process.wait, name="live view ends", daemon=True).start()
