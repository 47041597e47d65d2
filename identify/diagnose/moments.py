"""Short moments of a campaign that hold most of what a model leaves: somebody touched the bench, something slipped.

A moment is something that happens once and that the excitation does not explain. What a model lacks leaves most where
the motion is largest, as at the resonance that a chirp crosses; so a moment has to leave far more than other moments do
in which the excitation moves the platform as far and as fast, and drives it as hard. Nor is it a moment if most of what
is left there keeps step with the torque for several cycles: that is where a chirp passes a frequency at which the model
is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identify.diagnose.memory import RunResiduals
from identify.results import Moment
from rig.recording.run import Array

MOMENT_WINDOW_S = 0.25  # length of a window
MIN_WINDOWS = 12  # windows in a run: of fewer none is a moment
EVENT_POWER_RATIO = 10.0  # times the median power of the run's windows
MIN_TOTAL_SHARE = 0.5  # of the residual's power of all runs that they hold together
RARE = 0.1  # of all windows at most
MIN_EVENT_SHARE = 0.05  # of the power: a moment with less is not told
MANY = 3  # moments: more are no accident
ALIKE = 0.8  # of the angle, rate and torque of a window; what grows as the fifth power of them differs by 0.8^10 = 1/9
CYCLES = 4.0  # of the torque: over fewer, a push may look like a piece of it
IN_STEP = 0.5  # of the power of a moment: what keeps step with the torque that far is no event


@dataclass(frozen=True)
class _Windows:
    """One run in windows: squares of the residual in each, and how large angle, rate and torque are about it.

    ``power`` and ``there`` (whether at least half of its samples count) have shape (windows,), ``size`` (windows, 3);
    ``left``, (n,), is the residual of the ``run``.
    """

    window_s: float
    end_s: float
    power: Array
    there: NDArray[np.bool_]
    size: Array
    run: RunResiduals
    left: Array

    def in_step(self, first: int, last: int) -> float:
        """Share of the power in windows first..last (excluded) that keeps step with the torque; 0 over few cycles."""
        length = round(self.window_s / self.run.step_s)
        span = slice(first * length, min(last * length, len(self.left)))
        left, torque = self.left[span], self.in_quadrature[span]
        cycles = np.abs(np.unwrap(np.angle(torque)) - np.angle(torque[0])) / (2.0 * np.pi)
        blocks = int(cycles[-1] / CYCLES)
        if blocks < 1:
            return 0.0
        block = np.minimum(cycles / cycles[-1] * blocks, blocks - 1).astype(int)
        told = 0.0
        for k in range(blocks):
            here = block == k
            columns = np.column_stack([torque[here].real, torque[here].imag])
            told += float(np.sum((columns @ np.linalg.lstsq(columns, left[here], rcond=None)[0]) ** 2))
        return told / max(float(left @ left), 1e-300)

    @cached_property
    def in_quadrature(self) -> NDArray[np.complex128]:
        """The torque less its mean, and as imaginary part the same a quarter of a cycle later, (n,)."""
        from scipy import signal  # noqa: PLC0415  slow to load

        return np.asarray(signal.hilbert(self.run.torque - np.mean(self.run.torque)))


def moments(
    runs: Sequence[RunResiduals], begins_s: Sequence[float], names: Sequence[str]
) -> tuple[tuple[Moment, ...], ...]:
    """The moments of each model's residual (``left``), none where it is spread over the runs.

    ``begins_s`` are the times of the runs' first samples, ``names`` what the runs are called.
    """
    return tuple(_of_one([_windows(r, i) for r in runs], begins_s, names) for i in range(2))


def _windows(run: RunResiduals, model: int) -> _Windows:
    length = max(1, round(MOMENT_WINDOW_S / run.step_s))
    at = np.arange(0, len(run.use), length)
    squares = np.where(run.use, run.left[:, model], 0.0) ** 2
    counts = np.add.reduceat(run.use.astype(int), at)
    # What the excitation makes of the platform, which a push does not; as measured where no model runs near the data.
    known = bool(np.any(run.rate_by_model))
    moved = (run.angle_by_model, run.rate_by_model) if known else (run.angle, run.rate)
    peaks = [np.maximum.reduceat(np.abs(x), at) for x in (moved[0] - np.median(moved[0]), moved[1], run.torque)]
    about = [np.max(np.stack([np.append(x[1:], x[-1]), x, np.append(x[0], x[:-1])]), axis=0) for x in peaks]
    end_s = (len(run.use) - 1) * run.step_s
    return _Windows(
        length * run.step_s, end_s, np.add.reduceat(squares, at), counts >= 0.5 * length, np.stack(about, axis=1),
        run, np.where(run.use, run.left[:, model], 0.0),
    )  # fmt: skip


def _of_one(runs: Sequence[_Windows], begins_s: Sequence[float], names: Sequence[str]) -> tuple[Moment, ...]:
    total = sum(float(np.sum(run.power)) for run in runs)
    sizes = np.concatenate([run.size[run.there] for run in runs])
    powers = np.concatenate([run.power[run.there] for run in runs])
    found, count = [], 0
    for run, begin_s, name in zip(runs, begins_s, names, strict=True):
        if np.sum(run.there) < MIN_WINDOWS or total <= 0.0:
            continue
        loud = run.power > EVENT_POWER_RATIO * float(np.median(run.power[run.there]))
        for k in np.flatnonzero(loud):
            alike = np.all(sizes >= ALIKE * run.size[k], axis=1)
            loud[k] = np.any(alike) and run.power[k] > EVENT_POWER_RATIO * float(np.median(powers[alike]))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], loud.astype(int), [0]])))
        for a, b in edges.reshape(-1, 2).tolist():
            if run.in_step(a, b) > IN_STEP:
                continue
            count += b - a
            share = float(np.sum(run.power[a:b])) / total
            end_s = min(b * run.window_s, run.end_s)
            found.append(Moment(name, begin_s + a * run.window_s, begin_s + end_s, share))
    rare = count <= RARE * sum(len(run.power) for run in runs)
    main = sorted((m for m in found if m.share > MIN_EVENT_SHARE), key=lambda m: -m.share)[:MANY]
    return tuple(main) if rare and sum(m.share for m in main) > MIN_TOTAL_SHARE else ()
