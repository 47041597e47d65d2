"""The interface for observers of a campaign (progress, display)."""

from __future__ import annotations

from typing import NamedTuple

from rig.excitation import PlannedSet
from rig.sequencer.recorder import SetStatistics


class Progress(NamedTuple):
    """Where a set stands."""

    name: str
    time_s: float
    duration_s: float
    late_max_s: float
    missed_ticks: int
    drops: int
    peak_torque_nm: float


class Observer:
    """Told how the campaign goes; each method may be overridden and has to be quick."""

    def set_begins(self, planned: PlannedSet, number: int, count: int) -> None:
        """Set ``number`` of ``count`` (from 1) is about to play."""

    def progress(self, progress: Progress) -> None:
        """About ten times a second while a set plays."""

    def set_ends(self, statistics: SetStatistics) -> None:
        """A set is over, complete or not."""

    def probed(self, finding: str) -> None:
        """The probe before the first set found nothing wrong."""
