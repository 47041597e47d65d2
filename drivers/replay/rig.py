"""Replay: a raw capture in place of the devices, through the same drivers, to the same samples.

``ReplayRig`` is a Rig and ``ReplayClock`` a clock: a sequencer that plays the same sets on them does, tick by
tick, what it did on the bench.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from drivers.amplifiers import make_amplifier
from drivers.bench.device_rig import DeviceRig
from drivers.bench.retiming import BenchRetiming
from drivers.bench.rig import exchange_of
from drivers.capture import wire_capture
from drivers.capture.wire_capture import Entry, read_capture, unpack_frame, unpack_torque
from drivers.codecs.lawicel import CanFrame
from drivers.gyroscopes import make_gyroscope
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import BenchConfig, ProbeConfig
from rig.errors import RecordingError
from rig.interface import (
    Exchange,
    GyroSample,
    Statement,
    Torque,
    TorqueOfTime,
    TorqueSample,
)

SAME_TORQUE_NM = 1e-6  # rounding of the same computation on another machine


class ReplayLink(CanLink):
    """What the drive said, handed out in the order in which it was heard; what is sent goes nowhere."""

    def __init__(self, take: Callable[[], CanFrame | None], clock: Callable[[], float]) -> None:
        self._take_frame = take
        self.clock = clock
        self.name = "replay"
        self.record = None
        self.idle = lambda: None
        self.listeners = []

    def send(self, frames: Sequence[CanFrame], urgent: bool = False) -> float:
        """Nothing is sent."""
        return self.clock()

    def poll(self) -> list[ReceivedFrame]:
        """The next frame of this stage of the capture."""
        frame = self._take_frame()
        if frame is None:
            return []
        heard = ReceivedFrame(self.clock(), frame)
        for listener in self.listeners:
            listener(heard)
        return [heard]

    def wait(self, timeout_s: float, until: Callable[[], bool], every: Callable[[], None] | None = None) -> bool:
        """Frames until the condition holds, or the stage has no more of them."""
        while not until():
            if not self.poll():
                return False
        return True

    def close(self) -> None:
        """Nothing to close."""


class ReplayClock:
    """Gives out the readings that the bench's clock gave out."""

    def __init__(self, readings: Sequence[float]) -> None:
        self._readings = list(reversed(readings))

    def now_s(self) -> float:
        """The next reading. Raises RecordingError when the capture is at its end."""
        if not self._readings:
            raise RecordingError("the raw capture ends here: the campaign that it holds was cut short")
        return self._readings.pop()

    def wait_until(self, deadline_s: float) -> float:
        """The next reading: the waiting is long over."""
        return self.now_s()


def _by_key(section: Mapping[str, Any]) -> dict[str, Any]:
    """A section with its driver's settings as keys of their own."""
    settings = {f"settings.{key}": value for key, value in section["settings"].items()}
    return {key: value for key, value in section.items() if key != "settings"} | settings


class ReplayRig(DeviceRig):
    """A rig whose devices are a capture.

    Parameters
    ----------
    path
        The capture (``raw/wire.cap``).

    Raises
    ------
    RecordingError
        If it is missing, or holds no configuration.
    """

    def __init__(self, path: Path) -> None:
        self._entries = list(read_capture(path))
        section = _section(self._entries, path)
        try:
            self.config, self._probed = BenchConfig.model_validate(section), "probe" in section
        except (ValidationError, TypeError) as error:
            raise RecordingError(f"{path}: the configuration in it was changed: {error}") from None
        self.gyroscope = make_gyroscope(self.config.gyroscope)
        self.amplifier = make_amplifier(self.config.amplifier)
        self._retiming = BenchRetiming(self.config.amplifier, self.gyroscope, self.amplifier)
        self.clock = ReplayClock([e.time_s for e in self._entries if e.kind == wire_capture.CLOCK])
        self._at = 0
        self._time_s = self._entries[0].time_s
        self._path = path
        self._link = ReplayLink(self._next_frame, lambda: self._time_s)

    def differences(self, given: BenchConfig) -> list[str]:
        """What a file says of the devices otherwise than the capture, one text a key; ports aside, which may change."""
        out = []
        for part, aside in (("gyroscope", {"port"}), ("amplifier", {"can"})):
            here = _by_key(getattr(given, part).model_dump(exclude=aside))
            there = _by_key(getattr(self.config, part).model_dump(exclude=aside))
            out += [
                f"bench.{part}.{key}: {here.get(key)} (the capture has {there.get(key)})"
                for key in sorted({*here, *there}) if here.get(key) != there.get(key)
            ]  # fmt: skip
        return out

    def statement(self) -> Statement:
        """Torque is SIMULATED: nothing moves."""
        return Statement(Torque.SIMULATED, (f"replay of {self._path}",))

    @property
    def probe(self) -> ProbeConfig | None:
        """As it was played; captures of versions that did not probe hold none."""
        return self.config.probe if self._probed and self.config.probe.play else None

    def _is_mark(self, entry: Entry, what: str) -> bool:
        return entry.kind == wire_capture.MARK and json.loads(entry.payload)["mark"] == what

    def _next_frame(self) -> CanFrame | None:
        """The next frame heard before the next step in the life of the rig; gyro bytes on the way are fed."""
        while self._at < len(self._entries):
            entry = self._entries[self._at]
            if entry.kind == wire_capture.MARK and not self._is_mark(entry, "config"):
                return None
            self._at += 1
            self._time_s = entry.time_s
            if entry.kind == wire_capture.GYRO_READ:
                self.gyroscope.feed(entry.payload, entry.time_s)
            elif entry.kind == wire_capture.CAN_SENT:
                self.amplifier.note_sent(entry.time_s, unpack_frame(entry.payload))
            elif entry.kind == wire_capture.CAN_READ:
                return unpack_frame(entry.payload)
        return None

    def _finish_stage(self, mark: str) -> None:
        """Everything up to the mark that ends this stage."""
        while self._link.poll():
            continue
        if self._at >= len(self._entries) or not self._is_mark(self._entries[self._at], mark):
            raise RecordingError(f"{self._path} ends before the bench was {mark}: nothing was played")
        self._at += 1

    def open(self) -> None:
        """Let the drivers hear what they heard."""
        self.amplifier.contact(self._link)
        self._finish_stage("opened")

    def arm(self) -> None:
        """As ``open``."""
        self.amplifier.arm(self._link)
        self._finish_stage("armed")
        self.amplifier.take_reported()

    def exchange(self, now_s: float, torque_nm: float) -> Exchange:
        """The next tick of the capture. Raises RecordingError when there is none."""
        gyro: list[GyroSample] = []
        sent: list[TorqueSample] = []
        while self._at < len(self._entries):
            entry = self._entries[self._at]
            self._at += 1
            if entry.kind == wire_capture.GYRO_READ:
                gyro += self.gyroscope.feed(entry.payload, entry.time_s)
            elif entry.kind == wire_capture.CAN_READ:
                self.amplifier.receive(ReceivedFrame(entry.time_s, unpack_frame(entry.payload)))
            elif entry.kind == wire_capture.CAN_SENT:
                frame = unpack_frame(entry.payload)
                self.amplifier.note_sent(entry.time_s, frame)
                nm = self.amplifier.sent_torque_nm(frame)
                sent += [] if nm is None else [TorqueSample(entry.time_s, nm)]
            elif entry.kind == wire_capture.TICK:
                self._same_campaign(torque_nm, unpack_torque(entry.payload))
                self._retiming.tick()
                return exchange_of(self.config, self.amplifier, gyro, sent)
        raise RecordingError(f"{self._path} ends here: the campaign that it holds was cut short")

    def _same_campaign(self, asked_nm: float, played_nm: float) -> None:
        """The guard and the plan have to ask for the torque that was played, or the answers belong to another set."""
        if abs(asked_nm - played_nm) > SAME_TORQUE_NM:
            raise RecordingError(
                f"{self._path} holds another campaign: {played_nm:.6g} N m were played where this configuration asks "
                f"for {asked_nm:.6g} N m. Replay it with the model, limits and excitation of that campaign."
            )

    def begin_set(self, torque: TorqueOfTime, start_s: float) -> None:
        """As on the bench."""
        self._retiming.begin_set(start_s)

    def end_set(self) -> None:
        """As on the bench."""
        self._retiming.end_set()

    def torque_off(self) -> None:
        """There is no torque."""

    def disarm(self) -> None:
        """There is nothing to disable."""

    def close(self) -> None:
        """There is nothing to close."""


def _section(entries: Sequence[Entry], path: Path) -> Mapping[str, Any]:
    for entry in entries:
        if entry.kind == wire_capture.MARK:
            values = json.loads(entry.payload)
            if values.get("mark") == "config":
                section: Mapping[str, Any] = values.get("bench")
                return section
    raise RecordingError(f"{path} holds no configuration: it was cut before the devices were contacted")
