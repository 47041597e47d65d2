"""Collects what one set measured, by the time stamps of the samples, and writes it to the journal as it comes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.excitation import PlannedSet
from rig.guard import Tick
from rig.interface import LowPass
from rig.recording.journal import Journal
from rig.recording.retiming import BEGUN_S, NO_RETIMING, Retiming, retimed
from rig.recording.rows import increasing, on_samples
from rig.recording.run import Run
from rig.sequencer.lateness import Lateness
from rig.signals import TorqueHold

JOURNAL_EVERY_S = 0.02  # between hand-overs to the journal, which buffers again: together far below 100 ms
EDGE_S = 1e-6  # rounding of time stamps at the ends of a set


@dataclass(frozen=True)
class SetStatistics:
    """How a set went.

    Parameters
    ----------
    late
        How late its ticks were played.
    missed_ticks
        Deadlines that passed without a tick.
    drops
        Gyro samples that arrived invalid.
    complete
        False where the set was cut short.
    """

    name: str
    late: Lateness
    missed_ticks: int
    drops: int
    peak_torque_nm: float
    complete: bool


class SetRecorder:
    """One set while it plays. Times are kept in seconds since ``start_s``.

    With ``keep`` false what the journal has is let go of, and there is no ``run``. ``rest_bias_rad_s`` is what the gyro
    read at rest before the set, for whoever follows the journal while it is written.
    """

    def __init__(
        self,
        planned: PlannedSet,
        start_s: float,
        torque_hold: TorqueHold,
        journal: Journal | None,
        low_pass: LowPass | None = None,
        keep: bool = True,
        rest_bias_rad_s: float = 0.0,
    ) -> None:
        self._planned = planned
        self.start_s = start_s
        self._end_s = planned.duration_s + EDGE_S
        self._torque_hold = torque_hold
        self._journal = journal
        self._low_pass: dict[str, float] = (
            {} if low_pass is None else {"rate_corner_hz": low_pass.corner_hz, "rate_delay_s": low_pass.delay_s}
        )
        self._rest_bias_rad_s = rest_bias_rad_s
        self._open = False
        self._keep = keep or journal is None
        self._late = Lateness()
        self._samples: list[tuple[float, float, bool]] = []
        self._commands: list[tuple[float, float, float]] = []
        self._ticks: list[tuple[float, ...]] = []
        self._channel_names: tuple[str, ...] = ()
        self._written = [0, 0, 0]
        self._packed: tuple[Array, Array, Array] | None = None
        self._handed_s = start_s
        self.missed_ticks = 0
        self.drops = 0
        self.peak_torque_nm = 0.0

    def take(self, tick: Tick) -> None:
        """Keep what this tick brought, as far as it belongs to the set."""
        start, end = self.start_s, self._end_s
        for time_s, rate, valid in tick.gyro:
            at = time_s - start
            if -EDGE_S <= at <= end:
                self._samples.append((at, rate, valid))
                if not valid:
                    self.drops += 1
        for time_s, torque in tick.torque:
            at = time_s - start
            if -EDGE_S <= at <= end:
                self._commands.append((at, torque, tick.torque_nm))
                self.peak_torque_nm = max(self.peak_torque_nm, abs(torque))
        if not self._late.ticks and tick.channels:
            self._channel_names = tuple(tick.channels)
        late = tick.late_s
        if tick.now_s - start <= end:
            readings = [tick.channels[name] for name in self._channel_names] if self._channel_names else ()
            self._ticks.append((tick.now_s - start, late, *readings))
            self._late.add(late)
            if late >= tick.period_s:
                self.missed_ticks += int(late / tick.period_s + 1e-9)
        if self._journal is not None and tick.now_s - self._handed_s >= JOURNAL_EVERY_S:
            self._handed_s = tick.now_s
            self.write()

    @property
    def late_max_s(self) -> float:
        """How late the latest tick was."""
        return self._late.max_s

    def write(self) -> None:
        """Hand what is new to the journal. Raises JournalError where that cannot be written."""
        if self._journal is None:
            return
        if not self._open:
            meta = {
                "use": self._planned.use,
                "torque_hold": self._torque_hold,
                "frequency_hz": self._planned.frequency_hz,
                "scale": self._planned.scale,
                BEGUN_S: self.start_s,
                "rest_bias_rad_s": self._rest_bias_rad_s,
            } | self._low_pass
            columns = {"ticks": ("time_s", "late_s", *self._channel_names)}
            self._journal.begin_run(self._planned.name, meta, columns)
            self._open = True
        tables: tuple[tuple[str, list[Any]], ...] = (
            ("samples", self._samples),
            ("commands", self._commands),
            ("ticks", self._ticks),
        )
        for i, (kind, rows) in enumerate(tables):
            if len(rows) > self._written[i]:
                self._journal.append(kind, np.array(rows[self._written[i] :], dtype=float))
                self._written[i] = len(rows)
        if not self._keep:
            for _, rows in tables:
                rows.clear()
            self._written = [0, 0, 0]

    def close(self, complete: bool = True) -> None:
        """Write the rest and end the run in the journal, which notes whether the set was played whole.

        The rows are kept as arrays from here on, in a fifth of the memory.
        """
        self._packed = self._rows()
        self.write()
        if self._journal is not None and self._open:
            self._journal.end_run(complete)
        for rows in (self._samples, self._commands, self._ticks):
            rows.clear()

    def _rows(self) -> tuple[Array, Array, Array]:
        """Samples, commands and ticks, shape (n, columns) each."""
        if self._packed is not None:
            return self._packed
        samples = np.array(self._samples, dtype=float).reshape(-1, 3)
        commands = np.array(self._commands, dtype=float).reshape(-1, 3)
        return samples, commands, np.array(self._ticks, dtype=float)

    def statistics(self, complete: bool) -> SetStatistics:
        """How the set went."""
        return SetStatistics(
            self._planned.name, self._late, self.missed_ticks, self.drops, self.peak_torque_nm, complete
        )

    def run(self, better: Retiming = NO_RETIMING) -> Run | None:
        """The set as a Run, with what is known better of its times; None where fewer than two samples arrived.

        Time stamps that run backwards are dropped: a device that repeats itself must not spoil the record.
        """
        samples, commands, ticks = self._rows()
        samples, commands = increasing(samples), increasing(commands)
        if len(samples) < 2 or len(commands) < 1:
            return None
        time_s = retimed(samples[:, 0].copy(), better.samples)
        channels = on_samples(ticks, self._channel_names, 2, time_s)
        return Run(
            name=self._planned.name,
            time_s=time_s,
            valid=samples[:, 2] > 0.5,
            rate_rad_s=samples[:, 1].copy(),
            torque_time_s=retimed(commands[:, 0].copy(), better.torque),
            torque_nm=commands[:, 1].copy(),
            torque_hold=self._torque_hold,
            use=self._planned.use,
            frequency_hz=self._planned.frequency_hz,
            channels=channels,
            rate_corner_hz=self._low_pass.get("rate_corner_hz"),
            rate_delay_s=self._low_pass.get("rate_delay_s"),
        )
