"""A torque that nobody recorded and that settles: the whole recording shows it, a part of it does not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.residual import Disturbance
from identify.runs.holdout import split
from identify.select.field_search import _with_whole
from identify.signals.trace import Trace
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import traces_of

JCK = (0.02, 0.1, 0.0)
SETTLING_NM, SETTLING_S, SECONDS, PART_S = 2.0, 2.0, 12.0, 2.5
MODEL = Structure(("inertia", "damping"), ("torque_offset",))
CUTOFF_HZ = 20.0


def run(
    number: int, seconds: float, begins_s: float = 0.0, settling_nm: float = SETTLING_NM, drag: float = 0.0
) -> Run:  # fmt: skip
    """A multisine, read by an encoder, from some time on."""
    time = np.arange(round(SECONDS / 1e-3) + 1) * 1e-3
    rng = np.random.default_rng(number)
    torque = sum(
        3.0 * np.sin(2 * np.pi * f * time + p) for f, p in zip((0.7, 1.9, 3.1), 6.0 * rng.random(3), strict=True)
    )
    felt = torque + settling_nm * np.exp(-time / SETTLING_S) + 0.05 * rng.standard_normal(len(time))
    platform = Platform(*JCK, {"quadratic_damping": {"factor": drag}} if drag else {})
    angle = simulate(platform, time, TorqueSignal(time, felt), start=(0.0, 0.0), substeps=4).angle_rad
    angle = angle + 1e-5 * rng.standard_normal(len(time))
    part = slice(round(begins_s / 1e-3), round((begins_s + seconds) / 1e-3))
    t = time[part]
    return Run(
        f"run {number}", t, np.ones(len(t), bool), angle_rad=angle[part], torque_time_s=t, torque_nm=torque[part]
    )


@cache
def traces(
    seconds: float = SECONDS, begins_s: float = 0.0, settling_nm: float = SETTLING_NM, drag: float = 0.0
) -> list[Trace]:  # fmt: skip
    return traces_of(Recording(tuple(run(k, seconds, begins_s, settling_nm, drag) for k in range(2))))


def left_in(some: list[Trace]) -> tuple[TorqueRegression, TorqueFit, Disturbance]:
    regression = TorqueRegression(some, split(some, "auto"), CUTOFF_HZ, scale_of(some, JCK, ()))
    fit = regression.solve(MODEL, {})
    return regression, fit, disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m")


def test_what_settles_depends_on_the_time() -> None:
    """Blocks that are held out lie between others: a curve with few knots had made anything of them."""
    left = left_in(traces())[2]
    assert left.depends_on[0].on == "time"
    time = np.arange(0.0, SECONDS, 0.01)
    settles = SETTLING_NM * np.exp(-time / SETTLING_S)
    assert left.depends_on[0].torque_rms == pytest.approx(np.std(settles), rel=0.2)
    shape = np.interp(time, left.depends_on[0].at, left.depends_on[0].shape_nm)
    assert np.corrcoef(shape, -settles)[0, 1] > 0.98  # a torque resists


def test_a_torque_that_wanders_for_itself_in_every_run_does_not() -> None:
    assert all(d.on != "time" for d in left_in(traces(settling_nm=0.0))[2].depends_on)


def test_a_part_of_the_recording_does_not_speak_for_what_changes_along_it() -> None:
    part = traces(PART_S, 9.0)
    regression, fit, left = left_in(part)
    assert all(d.on != "time" for d in left.depends_on)
    whole = _with_whole(left, regression, fit, traces(), split(traces(), "auto"), "N*m")
    assert whole.depends_on[0].on == "time"
    assert whole.depends_on[0].relative == pytest.approx(whole.depends_on[0].torque_rms / regression.torque_nm)
    assert whole.torque_rms >= whole.depends_on[0].torque_rms
    assert _with_whole(left, regression, fit, part, split(part, "auto"), "N*m") == left


def test_how_far_the_numbers_move_with_what_is_not_asked_about_does_not_count() -> None:
    regression, fit, left = left_in(traces(drag=0.002))
    assert {"rate", "time"} <= {d.on for d in left.depends_on}
    settles = disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), "N*m", "time")
    assert [d.on for d in settles.depends_on] == ["time"]
    assert settles.moves_percent["damping"] < 0.2 * left.moves_percent["damping"]
