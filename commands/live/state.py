"""What the live page shows, from the frames of the journal and from what the campaign's process says."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from commands.live.envelope import Envelope
from rig.arrays import Array
from rig.recording.following import rows_of
from rig.recording.journal import BLOCK, RUN, RUN_END

NOTES = 12  # of the identification, the last ones
RECENT_S = 1.0  # over which validity and lateness are shown
Table = dict[str, list[Array]]


@dataclass
class PlayedSet:
    """One set as the journal has it so far: ``tables`` maps a kind to its blocks, shape (n, columns) each."""

    name: str
    meta: Mapping[str, Any]
    columns: Mapping[str, list[str]]
    tables: Table = field(default_factory=dict)
    torque: Envelope = field(default_factory=Envelope)
    rate: Envelope = field(default_factory=Envelope)
    angle: Envelope = field(default_factory=Envelope)
    late: Envelope = field(default_factory=Envelope)
    recent: list[tuple[float, bool]] = field(default_factory=list)
    angle_rad: float = 0.0
    last_sample: tuple[float, float] | None = None
    time_s: float = 0.0
    late_max_s: float = 0.0
    peak_torque_nm: float = 0.0
    drops: int = 0

    def add(self, kind: str, rows: Array) -> None:
        """Further rows of a kind, shape (n, columns)."""
        self.tables.setdefault(kind, []).append(rows)
        take = {"samples": self._samples, "commands": self._commands, "ticks": self._ticks}.get(kind)
        if take is not None and len(rows):
            take(rows, self.columns.get(kind, []))

    def _samples(self, rows: Array, names: list[str]) -> None:
        time_s, valid = rows[:, names.index("time_s")], rows[:, names.index("valid")] > 0.5
        self.drops += int(np.sum(~valid))
        self.recent += list(zip(time_s.tolist(), valid.tolist(), strict=True))
        self.recent = [one for one in self.recent if one[0] >= time_s[-1] - RECENT_S]
        if "rate_rad_s" in names:
            rate = np.where(valid, rows[:, names.index("rate_rad_s")], np.nan)
            self.rate.add(time_s, np.degrees(rate))
            if "angle_rad" not in names:
                self.angle.add(time_s, np.degrees(self._integrated(time_s, rate)))
        if "angle_rad" in names:
            self.angle.add(time_s, np.degrees(np.where(valid, rows[:, names.index("angle_rad")], np.nan)))

    def _integrated(self, time_s: Array, rate_rad_s: Array) -> Array:
        """The angle since the start of the set, the gyro's bias at rest taken off; a lost sample is bridged."""
        bias = float(self.meta.get("rest_bias_rad_s") or 0.0)
        out = []
        for t, rate in zip(time_s.tolist(), rate_rad_s.tolist(), strict=True):
            if math.isfinite(rate):
                if self.last_sample is not None:
                    before_s, before = self.last_sample
                    self.angle_rad += 0.5 * (t - before_s) * (rate + before - 2.0 * bias)
                self.last_sample = (t, rate)
            out.append(self.angle_rad)
        return np.array(out)

    def _commands(self, rows: Array, names: list[str]) -> None:
        torque = rows[:, names.index("torque_nm")]
        self.torque.add(rows[:, names.index("time_s")], torque)
        self.peak_torque_nm = max(self.peak_torque_nm, float(np.max(np.abs(torque))))

    def _ticks(self, rows: Array, names: list[str]) -> None:
        time_s, late_s = rows[:, names.index("time_s")], rows[:, names.index("late_s")]
        self.time_s = float(time_s[-1])
        self.late.add(time_s, 1e3 * late_s)
        self.late_max_s = max(self.late_max_s, float(np.max(late_s)))


class LiveState:
    """All that the page shows."""

    def __init__(self) -> None:
        self.phase = "waiting"
        self.planned: list[Mapping[str, Any]] = []
        self.limits: Mapping[str, float] = {}
        self.number = 0
        self.played: PlayedSet | None = None
        self.complete: list[PlayedSet] = []
        self.fits: list[Mapping[str, Any]] = []
        self.notes: list[str] = []
        self.result = self.report = ""
        self.stop_asked = False

    def take(self, kind: int, payload: bytes) -> None:
        """One frame of the journal."""
        if kind == RUN:
            head = json.loads(payload)
            self.played = PlayedSet(head["name"], head["meta"], head["columns"])
            self.number += 1
            self.phase = "playing"
        elif kind == BLOCK and self.played is not None:
            self.played.add(*rows_of(payload))
        elif kind == RUN_END and self.played is not None:
            self.phase = "rest"
            if json.loads(payload or b"{}").get("complete"):
                self.complete.append(self.played)

    def tell(self, said: Mapping[str, Any]) -> None:
        """A line of the campaign's process."""
        if "sets" in said:
            self.planned, self.limits, self.number = list(said["sets"]), said["limits"], 0
        if "note" in said:
            self.phase = "identifying"
            self.notes = [*self.notes, str(said["note"])][-NOTES:]
        if "result" in said:
            self.phase, self.result, self.report = "done", str(said["result"]), str(said.get("report", ""))

    def snapshot(self) -> dict[str, Any]:
        """Everything as JSON values."""
        out: dict[str, Any] = {
            "phase": self.phase, "limits": dict(self.limits), "count": len(self.planned), "number": self.number,
            "fits": self.fits, "notes": self.notes, "result": self.result, "report": self.report,
            "stop_asked": self.stop_asked, "set": None,
        }  # fmt: skip
        p = self.played
        if p is not None:
            durations = [s["duration_s"] for s in self.planned if s["name"] == p.name]
            valid = [ok for _, ok in p.recent]
            out["set"] = {
                "name": p.name, "time_s": round(p.time_s, 2), "duration_s": durations[0] if durations else None,
                "late_max_ms": round(1e3 * p.late_max_s, 3), "drops": p.drops,
                "peak_torque_nm": float(f"{p.peak_torque_nm:.4g}"),
                "valid_percent": round(100.0 * sum(valid) / len(valid), 1) if valid else None,
                "torque": p.torque.points(), "rate": p.rate.points(), "angle": p.angle.points(),
                "late": p.late.points(),
            }  # fmt: skip
        return out
