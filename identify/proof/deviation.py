"""How far a run strays from the linear model: its own start state and bias fitted, as everywhere, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.bounds.cramer_rao import vector_of
from identify.estimate.output_error import refine
from identify.follow_up.pairs import free_run
from identify.proof.compensation import linear_part
from identify.proof.drive import Drive
from identify.proof.given import as_set
from identify.proof.standing import Standing, remembers
from identify.proven import Share
from identify.results import NORMAL_95
from identify.signals.prepare import prepare
from rig.arrays import Array, Mask
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import PlannedSet
from rig.platform import Platform
from rig.recording.run import Run

JACKKNIFE_BLOCKS = 20  # of a set, each left out once (Quenouille 1956): far longer than what the noise remembers
NO_MORE_THAN_NOISE = 1.1  # root mean square over noise: below it an error is too small for a share of it


@dataclass(frozen=True)
class Deviation:
    """Measured less linear model over one run.

    Parameters
    ----------
    time_s
        Shape (n,), seconds since the set itself began (a compensated run begins before it).
    error
        Shape (n,), in the unit of the measured channel.
    keep
        Shape (n,): samples that count.
    noise
        Standard deviation of the sensor's noise.
    """

    time_s: Array
    error: Array
    keep: Mask
    noise: float

    @property
    def rms(self) -> float:
        """Root mean square over the samples that count."""
        return float(np.sqrt(np.mean(self.error[self.keep] ** 2))) if np.any(self.keep) else 0.0

    def squares(self, duration_s: float) -> tuple[Array, Array]:
        """Sum of squares less that of the noise, and number of samples, in each of the blocks of a set."""
        block = np.clip((self.time_s / duration_s * JACKKNIFE_BLOCKS).astype(int), 0, JACKKNIFE_BLOCKS - 1)
        counts = np.bincount(block[self.keep], minlength=JACKKNIFE_BLOCKS).astype(float)
        squares = np.bincount(block[self.keep], self.error[self.keep] ** 2, minlength=JACKKNIFE_BLOCKS)
        return squares - self.noise**2 * counts, counts


def explained_left(
    runs: Sequence[Run], model: Platform, without: Platform, noise: float | None, iterations: int = 8
) -> float:
    """What a model leaves of the error that another leaves in runs without compensation, both fitted anew (rms ratio).

    All numbers are fitted, so that a name is not blamed for wrong ones. Infinite where the other leaves only noise.
    """
    traces = [prepare(run, i, noise) for i, run in enumerate(runs)]
    level = float(np.mean([t.noise**2 for t in traces]))
    squares = []
    for platform in (model, without):
        structure, names, values = vector_of(platform, len(traces))
        start = dict(zip(names, values.tolist(), strict=True))
        squares.append(refine(traces, structure, start, None, iterations, coarse=True).sigma ** 2 - level)
    return _root(squares[0] / squares[1]) if squares[1] > 0.0 and np.isfinite(squares[0]) else np.inf


def deviation(run: Run, planned: PlannedSet, platform: Platform, noise: float | None) -> Deviation:
    """How far a run strays from the linear part of a platform.

    The linear part is given the torque as it was recorded, less the compensation: rounding and late ticks of the drive
    are in both and no error of the model (``as_set``).

    Raises
    ------
    ValueError
        Where the run has no torque.
    """
    run, lead_s = as_set(run, planned, platform)
    return beside(run, linear_part(platform), lead_s, noise)


def beside(run: Run, platform: Platform, lead_s: float, noise: float | None) -> Deviation:
    """Measured less a platform in free run under the torque of the run; its set begins ``lead_s`` after the run."""
    trace = prepare(run, 0, noise)
    fitted = free_run(platform, [trace])
    (error,), (shots,) = fitted.residuals(), fitted.shots
    time_s = trace.start_s + trace.step_s * np.arange(len(error)) - lead_s
    keep = shots.weight & np.isfinite(error) & (time_s >= 0.0)
    return Deviation(time_s, np.asarray(error), keep, trace.noise)


def simulated_run(
    planned: PlannedSet, platform: Platform, drive: Drive, angle: bool, aside_rad: float = 0.0,
    begin: Standing | None = None,
) -> Run:  # fmt: skip
    """What a platform would show of a planned set without noise, its torque as late, held and rounded as the drive's.

    It begins at rest, so far beside where the spring holds it; as if nothing had moved it where ``begin`` is None.
    """
    begin = begin or Standing.untouched(platform)
    time_s = drive.tick_s * np.arange(round(planned.duration_s / drive.tick_s) + 1)
    late_s = time_s + drive.latency_s
    torque_nm = drive.played(np.asarray(planned.torque(time_s), dtype=float))
    start = (begin.angle_rad + aside_rad, 0.0)
    states = begin.states.copy() if remembers(platform) else None
    with np.errstate(all="ignore"):
        motion = simulate(platform, time_s, TorqueSignal(late_s, torque_nm, drive.hold), start, states=states)
    return Run(
        planned.name, time_s, np.ones(len(time_s), dtype=bool),
        rate_rad_s=None if angle else motion.sensed_rate_rad_s, angle_rad=motion.angle_rad if angle else None,
        torque_time_s=late_s, torque_nm=torque_nm, torque_hold=drive.hold, frequency_hz=planned.frequency_hz,
    )  # fmt: skip


def share_left(pairs: list[tuple[Deviation, Deviation, float]]) -> Share | None:
    """The share of an error that compensation leaves, noise apart: root of the ratio of mean squares over all sets.

    ``pairs`` are deviations without and with compensation, and the length of their set in s. The interval leaves every
    block of time out once, in both runs of a set (jackknife). None where the error without is no more than noise.
    """
    found = [(a.squares(d), b.squares(d)) for a, b, d in pairs]
    before = np.concatenate([a / np.maximum(n, 1.0) for (a, n), _ in found])
    after = np.concatenate([b / np.maximum(n, 1.0) for _, (b, n) in found])
    noise = float(np.mean([a.noise**2 for a, _, _ in pairs]))
    if not float(np.mean(before)) > (NO_MORE_THAN_NOISE**2 - 1.0) * noise:
        return None
    total = float(np.sum(after) / np.sum(before))
    rest = (np.sum(after) - after) / (np.sum(before) - before)
    count = len(rest)
    spread = float(np.sqrt((count - 1) / count * np.sum((rest - np.mean(rest)) ** 2)))
    low, high = total - NORMAL_95 * spread, total + NORMAL_95 * spread
    return Share(_root(total), (_root(low), _root(high)))


def _root(ratio: float) -> float:
    return float(np.sqrt(max(ratio, 0.0)))
