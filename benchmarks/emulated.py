"""Emulated devices and a host that plays on them, each a process of its own, for what is done to either.

The devices are those of `rig emulate`, so they outlive whatever is done to the host, and tell in their own words
when the torque was zero.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import select
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from benchmarks.preloaded import Started, parent
from drivers.capture.wire_capture import FILE_NAME, MARK, TICK, read_capture
from rig.errors import RigError
from rig.recording.journal_reader import read_journal

CONFIG = "examples/bench.yaml"
SET_S = 4.0
SHORT = (
    f"excitation.sets=[{{torque_nm: 60, frequency_hz: 3, duration_s: {SET_S:g}}}]", "excitation.rest_s=0.5",
    "bench.settle_s=1", "bench.emulator.start_up_s=0.1", "bench.emulator.ports=socket",
)  # fmt: skip
TO_THE_SET_S = 2.0  # from enabled to the first set: settling, probe, rest
OFF = ("torque_zero", "watchdog", "fault", "disabled")
START_S, STOP_S = 60.0, 5.0
Event = dict[str, Any]


class Devices:
    """`rig emulate`, while the context lasts. ``events`` so far, each with its time on the monotonic clock."""

    def __init__(self, overrides: Sequence[str] = SHORT, config: str = CONFIG) -> None:
        line = ["emulate", config]
        for override in overrides:
            line += ["--set", override]
        self._folder = tempfile.TemporaryDirectory()
        pipes = [str(Path(self._folder.name) / name) for name in ("requests", "events")]
        for pipe in pipes:
            os.mkfifo(pipe)
        self._requests = os.open(pipes[0], os.O_RDWR)
        self._told = os.open(pipes[1], os.O_RDONLY | os.O_NONBLOCK)
        os.set_blocking(self._told, True)
        self.process = parent().start("rig", line, pipes[0], pipes[1], os.devnull)
        self.events: list[Event] = []
        self._news: queue.SimpleQueue[Event] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()
        self.ports = self.wait_for(("listening",), START_S) or {}

    def _listen(self) -> None:
        rest = b""
        while select.select([self._told], [], [], START_S)[0]:
            part = os.read(self._told, 65_536)
            if not part:
                if self.process.poll() is not None:
                    break
                time.sleep(0.01)  # not open yet at the other end
            *lines, rest = (rest + part).split(b"\n")
            for line in lines:
                event = json.loads(line)
                self.events.append(event)
                self._news.put(event)

    def wait_for(self, names: Sequence[str], timeout_s: float) -> Event | None:
        """The next event of one of these names, or None."""
        end_s = time.monotonic() + timeout_s
        while (left_s := end_s - time.monotonic()) > 0.0:
            try:
                event = self._news.get(timeout=left_s)
            except queue.Empty:
                return None
            if event["event"] in names:
                return event
        return None

    def inject(self, **fault: object) -> None:
        """Let a fault take hold."""
        os.write(self._requests, (json.dumps(fault) + "\n").encode())

    def first(self, names: Sequence[str], from_s: float) -> Event | None:
        """The first event of these names at or after a moment."""
        return next((e for e in self.events if e["event"] in names and e["time_s"] >= from_s), None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.process.terminate()
        try:
            self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        time.sleep(0.05)  # until the listening thread has seen the end
        for descriptor in (self._requests, self._told):
            os.close(descriptor)
        self._folder.cleanup()


def ports_of(devices: Devices) -> tuple[str, str]:
    """The settings by which a host finds emulated devices."""
    return f"bench.gyroscope.port={devices.ports['gyro']}", f"bench.amplifier.can.channel={devices.ports['can']}"


@dataclass
class Host:
    """A process that plays on emulated devices, by `rig play` unless told otherwise."""

    devices: Devices
    folder: Path
    overrides: Sequence[str] = SHORT
    command: str = "play"
    terminal: str | None = None  # a terminal of its own, that it loses when the other end is closed
    log: Path | None = None  # where it says what it says; beside the folder unless told otherwise
    results: Path | None = None  # where its results go, which would be written over what it says
    process: Started = field(init=False)

    def __post_init__(self) -> None:
        self.log = self.log or self.folder.with_suffix(".log")
        said = self.terminal or str(self.log)
        results = self.terminal or str(self.results or self.log)
        self.process = parent().start("host", self.line(), self.terminal or os.devnull, results, said)

    def line(self) -> list[str]:
        """What follows `rig`."""
        line = [self.command, CONFIG, "--yes", "--out", str(self.folder)]
        for override in (*ports_of(self.devices), *self.overrides):
            line += ["--set", override]
        return line

    def send(self, *signals: int) -> float:
        """Signals, one after the other; the moment of the first."""
        at_s = time.monotonic()
        for number in signals:
            with contextlib.suppress(ProcessLookupError):  # it ended before: what is measured then says so
                os.kill(self.process.pid, number)
        return at_s

    def ended(self, timeout_s: float) -> int | None:
        """Its exit code, or None where it had to be killed because it hung."""
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return None

    @property
    def said(self) -> str:
        """What it said, in one line."""
        if self.log is None or not self.log.exists():
            return ""
        return " ".join(self.log.read_text(errors="replace").split())

    def left_over(self) -> list[int]:
        """Processes of its session that still live."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    fields = (entry / "stat").read_text().rpartition(")")[2].split()
                except OSError:
                    continue
                if int(fields[3]) == self.process.pid and fields[0] != "Z":
                    found.append(int(entry.name))
        return found


@dataclass(frozen=True)
class Recovered:
    """What is in the files of a run, whatever ended it; times on the monotonic clock, None where there is none.

    ``verdict_s`` is the instant at which the host knew that something was wrong; ``in_set`` whether the last that the
    files tell of is a set that has begun.
    """

    last_sample_s: float | None
    last_tick_s: float | None
    verdict_s: float | None
    problem: str = ""
    in_set: bool = False


def recovered(folder: Path, part: str = "") -> Recovered:
    """Read the journal and the raw capture of a folder as `rig recover` does, or those of a further part of it."""
    raw, journal_file = folder / "raw" / part, folder / f"{part or 'recording'}.journal"
    starts: list[float] = []
    in_set = False
    last_tick: float | None = None
    try:
        for entry in read_capture(raw / FILE_NAME):
            if entry.kind == MARK:
                mark = json.loads(entry.payload)
                in_set = mark["mark"] == "begin_set"
                starts += [float(mark["start_s"])] if in_set else []
            elif entry.kind == TICK:
                last_tick = entry.time_s
        journal = read_journal(journal_file)
    except RigError as problem:
        return Recovered(None, last_tick, None, str(problem))
    verdicts = [event.values["verdict_s"] for event in journal.events if event.values.get("verdict_s") is not None]
    last = None
    if in_set and len(starts) > len(journal.runs):
        # The set has begun and no row of it is in the file yet: it is lost from its start, and not the rest before it.
        last = starts[len(journal.runs)]
    elif journal.runs and len(starts) >= len(journal.runs):
        run = journal.runs[-1]
        times = [float(t) for t in run.column("ticks", "time_s")] if "ticks" in run.tables else []
        last = starts[len(journal.runs) - 1] + times[-1] if times else None
    return Recovered(last, last_tick, verdicts[-1] if verdicts else None, in_set=in_set)


def interrupt_twice(host: Host) -> float:
    """Ctrl-C, and again before it can have been heeded."""
    at_s = host.send(signal.SIGINT)
    time.sleep(0.002)
    host.send(signal.SIGINT)
    return at_s
