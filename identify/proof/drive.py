"""How a rig takes its torque: when, how long it is held, in which steps; and what a recording shows of that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.signals.noise import rounding_of
from rig.arrays import Array
from rig.excitation import PlannedSet
from rig.recording.run import Recording
from rig.signals import TorqueHold

PARTS = 8  # of a tick: a torque that jumps is placed to an eighth of one, and its area exactly
NO_LATENCY = 0.02  # of a tick: the rounding of commands
MAX_LATENCY_S = 0.05  # later than that it is another torque
UNLIKE = 0.1  # of a recorded torque that may differ from the planned one
MIN_LATENCY_SAMPLES = 100  # samples of the torque of a run
LAG_STEPS = 4  # Gauss-Newton steps of the latency


@dataclass(frozen=True)
class Drive:
    """How a rig takes its torque: a command a tick, held until the next or read off a smooth curve.

    ``resolution_nm`` is the step to which it rounds a held command; None where it does not, or nobody knows.
    ``latency_s`` is by how much later than it is asked for a torque is there: no model knows it, for the torque that
    is recorded is that which was there.
    """

    tick_s: float
    hold: TorqueHold
    resolution_nm: float | None = None
    latency_s: float = 0.0

    @property
    def step_s(self) -> float:
        """Of the table of a compensating torque."""
        return self.tick_s / PARTS

    def played(self, torque_nm: Array) -> Array:
        """Commands in its steps, shape as given; as they are where it does not round."""
        if self.resolution_nm is None or self.hold != "zero_order":
            return torque_nm
        return np.asarray(self.resolution_nm * np.round(torque_nm / self.resolution_nm))


def latency_of(recording: Recording, sets: Sequence[PlannedSet], tick_s: float) -> float:
    """By how much later than it was asked for the torque of recorded sets was there, in s; 0 where that does not show.

    Recorded torque = a M(t - latency), of every run of the name of a set; the median of all runs.
    """
    runs = {run.name: run for run in recording.runs}
    found = [_lag(run.torque_time_s, run.torque_nm, s) for s in sets if (run := runs.get(s.name)) is not None]
    lags = [lag for lag in found if lag is not None]
    latency_s = float(np.median(lags)) if lags else 0.0
    return latency_s if latency_s > NO_LATENCY * tick_s else 0.0


def _lag(time_s: Array | None, torque_nm: Array | None, planned: PlannedSet) -> float | None:
    """By how much a recorded torque follows a planned one, by least squares (Gauss-Newton); None where it does not."""
    if time_s is None or torque_nm is None or len(time_s) < MIN_LATENCY_SAMPLES:
        return None
    lag_s = 0.0
    for _ in range(LAG_STEPS):
        at = time_s - lag_s
        shape = np.asarray(planned.torque(at), dtype=float)
        slope = np.asarray(planned.torque(at + 1e-5) - planned.torque(at - 1e-5), dtype=float) / 2e-5
        table = np.stack([shape, -slope], axis=1)
        (size, moved), *_ = np.linalg.lstsq(table, torque_nm, rcond=None)
        if not size > 0.0:
            return None
        lag_s += float(moved / size)
    left = torque_nm - table @ np.array([size, moved])
    alike = float(np.sum(left**2)) < UNLIKE**2 * float(np.sum(torque_nm**2))
    return lag_s if alike and abs(lag_s) < MAX_LATENCY_S else None


def resolution_of(recording: Recording) -> float | None:
    """The step to which a drive rounds its torque, in N m, as far as held torques of a recording show one."""
    held = [r.torque_nm for r in recording.runs if r.torque_nm is not None and r.torque_hold == "zero_order"]
    lost = [rounding_of(values) for values in held]
    steps = [math.sqrt(12.0) * std for std in lost if std]
    return min(steps) if steps else None
