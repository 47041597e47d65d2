"""Whether torque and motion were recorded with opposite signs: the sign that inertia and spring then seem to have.

Behind one low-pass, torque is regressed on acceleration, rate and angle (Eq. 1). A platform turns the way it is
pushed: an inertia below zero, or a spring below zero where the inertia does not show, is a matter of signs, as long
as the other of the two does not contradict and the regression explains the torque. Damping has no say, since a
delay turns it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identify.results import RunTraces
from identify.signals.low_pass import low_pass, settled
from rig.recording.run import Array

SIGN_SIGMAS = 4.0  # standard errors from zero
MIN_EXPLAINED_SHARE = 0.5  # share of the torque's power that the regression has to explain
INDEPENDENT_BLOCKS = 24  # stretches that are taken as independent: a residual is never white here

SENTENCE = (
    "torque and rate have opposite sign conventions (the platform seems to turn against the torque): check "
    "recorded.scale.torque and turn its sign, or the sign of the drive's torque constant on a bench"
)


@dataclass(frozen=True)
class Swing:
    """Motion and torque of one run, each of shape (n,); ``keep`` is positive where a sample counts."""

    time_s: Array
    angle_rad: Array
    rate_rad_s: Array
    torque_nm: Array | None
    keep: Array


@dataclass(frozen=True)
class Signs:
    """What a plain regression of the torque makes of inertia and spring.

    Attributes
    ----------
    inertia, stiffness
        Each over its own standard error.
    explained
        Share of the torque's power, 0 to 1.
    """

    inertia: float
    stiffness: float
    explained: float

    @property
    def opposite(self) -> bool:
        """Whether torque and motion have opposite sign conventions."""
        if self.explained < MIN_EXPLAINED_SHARE or max(self.inertia, self.stiffness) > SIGN_SIGMAS:
            return False
        return min(self.inertia, self.stiffness) < -SIGN_SIGMAS


def signs(traces: Sequence[RunTraces], cutoff_hz: float) -> Signs | None:
    """The signs that torque and motion of some runs show; None where no run holds a torque that moves."""
    rows, targets = [], []
    for trace in traces:
        found = equations(
            Swing(trace.time_s, trace.angle_rad, trace.rate_rad_s, trace.torque_nm, trace.keep), cutoff_hz
        )
        if found is not None:
            rows.append(found[0])
            targets.append(found[1])
    if not rows:
        return None
    x, y = np.concatenate(rows), np.concatenate(targets)
    size = np.linalg.norm(x, axis=0)
    if not np.all(size[:2] > 0.0) or not np.any(y):
        return None
    x = x / np.where(size > 0.0, size, 1.0)
    inverse = np.linalg.pinv(x.T @ x, rcond=1e-9, hermitian=True)
    values = inverse @ (x.T @ y)
    left = y - x @ values
    stretches = zip(np.array_split(x, INDEPENDENT_BLOCKS), np.array_split(left, INDEPENDENT_BLOCKS), strict=True)
    scores = np.stack([part.T @ rest for part, rest in stretches])
    error = np.sqrt(np.maximum(np.diag(inverse @ (scores.T @ scores) @ inverse), 1e-300))
    ratio = values / error
    return Signs(float(ratio[0]), float(ratio[2]), float(1.0 - (left @ left) / (y @ y)))


def equations(swing: Swing, cutoff_hz: float) -> tuple[Array, Array] | None:
    """Acceleration, rate and angle (n, 3) and torque (n,) of one run; unknown constant and ramp taken out."""
    if swing.torque_nm is None or np.ptp(swing.torque_nm) == 0.0:
        return None
    step = float(swing.time_s[-1] - swing.time_s[0]) / (len(swing.time_s) - 1)
    rate, angle, torque = (low_pass(v, cutoff_hz, step) for v in (swing.rate_rad_s, swing.angle_rad, swing.torque_nm))
    columns = np.stack([np.gradient(rate, step), rate, angle, torque], axis=1)
    keep = settled(swing.keep, step, cutoff_hz)
    if int(np.sum(keep)) < 4 * INDEPENDENT_BLOCKS or not np.all(np.isfinite(columns)):
        return None
    unknown = np.stack([np.ones(len(keep)), np.linspace(-1.0, 1.0, len(keep))], axis=1)[keep]
    clean = columns[keep] - unknown @ np.linalg.lstsq(unknown, columns[keep])[0]
    return clean[:, :3], clean[:, 3]
