"""What the runs of the campaign say of a compensation before it is played, whether the model is right or not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from identify.proof.compensation import cancelled
from rig import effects
from rig.arrays import Array
from rig.dynamics import TorqueSignal, simulate
from rig.effects.base import Place
from rig.excitation import CompensatedSet, PlannedSet
from rig.platform import Platform
from rig.preflight import Peaks
from rig.recording.run import Run

STEP_S = 1e-3  # of the grid on which peaks are foretold
MAX_TORQUE_RATIO = 1.05  # of the torque of a recorded set to which it speaks for a larger one


def expected_peaks(run: Run, plain: PlannedSet, planned: PlannedSet, model: Platform) -> Peaks | None:
    """Travel, rate and torque of a run as the recorded run of the same set lets expect them; None where it cannot.

    Recorded motion, in proportion to the torque, and on top what the further torque does to the linear part: first
    order in the compensation, whatever the platform's effects are. A model that explains the recording badly may
    predict a quiet run and excite a resonance.

    None under a compensation of dry friction: what that does turns with the sign of the rate, of which there is no
    first order (it would expect 430 deg/s where 31 come of 1 N m, benchmarks.proof).
    """
    if any(effects.get(name).place is Place.FRICTION for name in cancelled(model)):
        return None
    lead_s = planned.excitation.lead_s if isinstance(planned.excitation, CompensatedSet) else 0.0
    time_s: Array = STEP_S * np.arange(round(planned.duration_s / STEP_S) + 1)
    torque = np.asarray(planned.torque(time_s), dtype=float)
    own = np.asarray(plain.torque(time_s - lead_s), dtype=float)
    recorded_nm = 0.0 if run.torque_nm is None else float(np.max(np.abs(run.torque_nm), initial=0.0))
    times = float(np.max(np.abs(own), initial=0.0)) / recorded_nm if recorded_nm > 0.0 else math.inf
    if times > MAX_TORQUE_RATIO or run.rate_rad_s is None or np.sum(run.valid) < 2:
        return None
    ok = run.valid & np.isfinite(run.rate_rad_s)
    rate = times * np.interp(time_s - lead_s, run.time_s[ok], run.rate_rad_s[ok], left=0.0)
    still = replace(model, effects={})
    with np.errstate(all="ignore"):
        more = simulate(still, time_s, TorqueSignal(time_s, torque - own, "zero_order"))
    angle = _integral(time_s, rate) + more.angle_rad
    return Peaks(_degrees(angle), _degrees(rate + more.rate_rad_s), float(np.max(np.abs(torque), initial=0.0)))


def _integral(time_s: Array, rate_rad_s: Array) -> Array:
    """Angle of a rate, less the line that a bias makes of it."""
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate_rad_s[1:] + rate_rad_s[:-1])) * STEP_S])
    line = np.polynomial.Polynomial.fit(time_s, angle, 1)
    straight = angle - line(time_s)
    return straight if np.max(np.abs(straight)) < np.max(np.abs(angle)) else angle


def _degrees(values: Array) -> float:
    return math.degrees(float(np.max(np.abs(values)))) if np.all(np.isfinite(values)) else math.inf
