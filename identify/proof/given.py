"""The torque that the linear model is given: the set, and of the drive what no model is to blame for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.proof.drive import PARTS
from rig import effects
from rig.arrays import Array
from rig.dynamics import Equations, TorqueSignal
from rig.effects.base import Place
from rig.excitation import CompensatedSet, PlannedSet
from rig.platform import Platform
from rig.recording.run import Run


def as_set(run: Run, planned: PlannedSet, platform: Platform) -> tuple[Run, float]:
    """A run with the set alone as its torque, as it reaches the shaft, and how long after the run the set begins.

    What the recorded torque has beyond the planned one (rounding, late ticks) stays in it. It reaches the shaft as the
    rest does: through the drive of the platform.

    Raises
    ------
    ValueError
        Where no torque was recorded.
    """
    if run.torque_nm is None or run.torque_time_s is None:
        raise ValueError(f"{run.name}: no torque was recorded")
    made = planned.excitation
    spreads = any(effects.get(name).spreads for name in platform.effects)
    if not isinstance(made, CompensatedSet):
        return (_without_steps(run) if spreads else run), 0.0
    at_shaft_s, set_nm, exact_nm = made.asked(run.torque_time_s, run.torque_nm)
    if run.torque_hold != "zero_order" or not any(effects.get(n).inverse is not None for n in platform.effects):
        return replace(run, torque_time_s=at_shaft_s, torque_nm=set_nm + run.torque_nm - exact_nm), made.lead_s
    of_set = replace(run, torque_time_s=at_shaft_s, torque_nm=set_nm)
    return _with_rounding(_without_steps(of_set) if spreads else of_set, run, exact_nm, platform), made.lead_s


def _without_steps(run: Run) -> Run:
    """With a held torque as a smooth curve of the same mean over every tick: a drive that lags passes no steps on.

    Within a tick the steps move the rate by K tick^2 / (12 J) of itself, 0.3 % of a rate that is to be told to 0.1 %. A
    mean over a tick takes 1/24 of the second difference away from a curve.
    """
    time_s, torque_nm = run.torque_time_s, run.torque_nm
    if run.torque_hold != "zero_order" or time_s is None or torque_nm is None or len(time_s) < 3:
        return run
    bent = np.zeros(len(torque_nm))
    bent[1:-1] = torque_nm[2:] - 2.0 * torque_nm[1:-1] + torque_nm[:-2]
    middles_s = time_s + 0.5 * np.diff(time_s, append=2.0 * time_s[-1] - time_s[-2])
    return replace(run, torque_time_s=middles_s, torque_nm=torque_nm + bent / 24.0, torque_hold="band_limited")


def _with_rounding(of_set: Run, run: Run, exact_nm: Array, platform: Platform) -> Run:
    """The torque of a set, and what the drive makes of all that was recorded beyond the exact torque.

    Without its lag, the rounding to 0.12 N m of a drive that lags by 1 ms passes for 1.6 times the noise of a gyro of
    0.05 deg/s.
    """
    time_s, torque_nm = run.torque_time_s, run.torque_nm
    assert time_s is not None and torque_nm is not None and of_set.torque_time_s is not None
    assert of_set.torque_nm is not None
    step_s = float(np.median(np.diff(time_s))) / PARTS
    start_s = float(time_s[0])
    count = round((float(time_s[-1]) - start_s) / step_s) + PARTS
    drive = Equations(replace(platform, effects=_of_drive(platform))).drive
    recorded, exact = (
        drive.apply(TorqueSignal(time_s, nm, "zero_order").on_half_steps(start_s, step_s, count), step_s)
        for nm in (torque_nm, exact_nm)
    )
    of_set_nm = TorqueSignal(of_set.torque_time_s, of_set.torque_nm, of_set.torque_hold)
    middle_s = 0.0 if of_set_nm.hold == "zero_order" else 0.5 * step_s  # a held torque is given as a mean
    wanted = of_set_nm.on_half_steps(start_s + middle_s, step_s, count)
    fine_s: Array = start_s + step_s * np.arange(count)
    return replace(of_set, torque_time_s=fine_s, torque_nm=wanted + recorded - exact, torque_hold="zero_order")


def _of_drive(platform: Platform) -> dict[str, dict[str, float]]:
    return {n: dict(v) for n, v in platform.effects.items() if effects.get(n).place is Place.DRIVE}
