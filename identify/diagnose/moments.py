"""Short moments of a campaign that hold most of what a model leaves: somebody touched the bench, something slipped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.diagnose.memory import RunResiduals
from identify.results import Moment
from rig.recording.run import Array

WINDOW_S = 0.25  # length of a window
MIN_WINDOWS = 12  # windows in a run: of fewer none is a moment
EVENT_POWER_RATIO = 10.0  # times the median power of the run's windows
MIN_TOTAL_SHARE = 0.5  # of the residual's power of all runs that they hold together
RARE = 0.1  # of all windows at most
MIN_EVENT_SHARE = 0.05  # of the power: a moment with less is not told
MANY = 3  # moments: more are no accident


def moments(
    runs: Sequence[RunResiduals], begins_s: Sequence[float], names: Sequence[str]
) -> tuple[tuple[Moment, ...], ...]:
    """The moments of each model's residual (``left``), none where it is spread over the runs.

    ``begins_s`` are the times of the runs' first samples, ``names`` what the runs are called.
    """
    return tuple(_of_one([_windows(r, i) for r in runs], begins_s, names) for i in range(2))


def _windows(run: RunResiduals, model: int) -> tuple[float, Array]:
    """Length of a window in s, and the squares in each, (windows,)."""
    length = max(1, round(WINDOW_S / run.step_s))
    squares = np.where(run.use, run.left[:, model], 0.0) ** 2
    return length * run.step_s, np.add.reduceat(squares, np.arange(0, len(squares), length))


def _of_one(runs: Sequence[tuple[float, Array]], begins_s: Sequence[float], names: Sequence[str]) -> tuple[Moment, ...]:
    total = sum(float(np.sum(power)) for _, power in runs)
    found, count = [], 0
    for (window_s, power), begin_s, name in zip(runs, begins_s, names, strict=True):
        loud = power > EVENT_POWER_RATIO * float(np.median(power))
        if len(power) < MIN_WINDOWS or total <= 0.0 or not np.any(loud):
            continue
        count += int(np.sum(loud))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], loud.astype(int), [0]])))
        for a, b in edges.reshape(-1, 2).tolist():
            share = float(np.sum(power[a:b])) / total
            found.append(Moment(name, begin_s + a * window_s, begin_s + b * window_s, share))
    rare = count <= RARE * sum(len(power) for _, power in runs)
    main = sorted((m for m in found if m.share > MIN_EVENT_SHARE), key=lambda m: -m.share)[:MANY]
    return tuple(main) if rare and sum(m.share for m in main) > MIN_TOTAL_SHARE else ()
