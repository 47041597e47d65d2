"""A recording made from a raw capture alone: its bytes decoded by the drivers, cut at the marks of the sets.

Nobody has to know the configuration of then: the capture holds that of the devices, and the torque that was asked for
at every tick. What the plan said of a set (its name, its frequency) is not in it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drivers.capture.wire_capture import CLOCK, MARK
from drivers.replay.rig import ReplayRig
from rig.arrays import Array
from rig.errors import RecordingError
from rig.interface import GyroSample, LowPass, TorqueSample
from rig.recording.retiming import NO_RETIMING, Retiming, retimed
from rig.recording.rows import increasing, on_samples
from rig.recording.run import Recording, Run
from rig.sequencer.time_corrections import log_time_corrections

BEFORE_S = 1e-6  # rounding of time stamps at the start of a set


@dataclass
class _Set:
    """What belongs to one set, all times on the clock of the capture."""

    start_s: float
    gyro: list[GyroSample] = field(default_factory=list)
    torque: list[TorqueSample] = field(default_factory=list)
    ticks: list[tuple[float, ...]] = field(default_factory=list)
    channels: tuple[str, ...] = ()


def recording_from_capture(path: Path) -> Recording:
    """All sets of a capture, as far as it goes, named by their order.

    Raises RecordingError where it holds none, and what a driver raises that cannot follow it.
    """
    try:
        rig = _UncheckedReplay(path)
        with rig.opened(), rig.armed():
            sets = rig.sets()
        better = log_time_corrections(rig, None, lambda: 0.0)
        found = (_run(f"set {n}", one, rig.rate_low_pass, better) for n, one in enumerate(sets, 1))
        runs = tuple(run for run in found if run is not None)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, struct.error) as error:
        raise RecordingError(f"{path}: its records are not in the format of this version ({error!r})") from None
    if not runs:
        raise RecordingError(f"{path} ends before the first sample of a set: nothing was recorded")
    expected = {"expected_torque_delay": rig.expected_delay._asdict()}
    return Recording(runs, noise=rig.noise_rad_s, info={"backend": f"raw capture {path.name}"} | expected)


class _UncheckedReplay(ReplayRig):
    """Plays whatever was played."""

    def _same_campaign(self, asked_nm: float, played_nm: float) -> None:
        """There is no other plan than what was played."""

    def sets(self) -> list[_Set]:
        """Tick by tick to the end of the capture."""
        found: list[_Set] = []
        playing: _Set | None = None
        while True:
            for mark in self._marks():
                if mark.get("mark") == "begin_set":
                    start_s = float(mark["start_s"])
                    playing = _Set(start_s)
                    found.append(playing)
                    self.begin_set(lambda time_s: time_s, start_s)
                elif mark.get("mark") == "end_set" and playing is not None:
                    playing = None
                    self.end_set()
            try:
                reply = self.exchange(0.0, 0.0)
            except RecordingError:  # there is no further tick
                break
            if playing is not None:
                playing.gyro += reply.gyro
                playing.torque += reply.torque
                playing.channels = playing.channels or tuple(reply.channels)
                readings = [reply.channels[name] for name in playing.channels]
                playing.ticks.append((self._entries[self._at - 1].time_s, 0.0, *readings))
        if playing is not None:
            self.end_set()
        return found

    def _marks(self) -> list[Mapping[str, float | str]]:
        """Marks up to the next byte that crossed the wire."""
        marks = []
        while self._at < len(self._entries) and self._entries[self._at].kind in (MARK, CLOCK):
            entry = self._entries[self._at]
            self._at += 1
            if entry.kind == MARK:
                marks.append(json.loads(entry.payload))
        return marks


def _run(name: str, one: _Set, low_pass: LowPass | None, better: Mapping[float, Retiming]) -> Run | None:
    """As the recorder makes it; None where there are fewer than two samples."""
    samples: Array = np.array(one.gyro, dtype=float).reshape(-1, 3) - (one.start_s, 0.0, 0.0)
    torque: Array = np.array(one.torque, dtype=float).reshape(-1, 2) - (one.start_s, 0.0)
    samples = increasing(samples[samples[:, 0] >= -BEFORE_S])
    torque = increasing(torque[torque[:, 0] >= -BEFORE_S])
    if len(samples) < 2 or len(torque) < 1:
        return None
    stamps = better.get(one.start_s, NO_RETIMING)
    time_s = retimed(samples[:, 0].copy(), stamps.samples)
    ticks = np.array(one.ticks, dtype=float)
    ticks[:, 0] -= one.start_s
    return Run(
        name=name,
        time_s=time_s,
        valid=samples[:, 2] > 0.5,
        rate_rad_s=samples[:, 1].copy(),
        torque_time_s=retimed(torque[:, 0].copy(), stamps.torque),
        torque_nm=torque[:, 1].copy(),
        torque_hold="zero_order",
        channels=on_samples(ticks, one.channels, 2, time_s),
        rate_corner_hz=low_pass.corner_hz if low_pass else None,
        rate_delay_s=low_pass.delay_s if low_pass else None,
    )
