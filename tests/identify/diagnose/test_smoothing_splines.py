"""A curve over angle, rate or torque: as fine as held-out runs ask, and silent about values that it has not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.terms.curves import curves
from identify.diagnose.terms.free_form import FreeForm, smooth_splines
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.runs.holdout import split
from rig.recording.run import Recording, Run
from tests.identify.simulated import TRUTH, sine_run, traces_of

SETS = ((111.0, 1.0), (104.0, 3.0), (67.0, 6.0), (80.0, 2.0))
RIPPLE_NM, PERIOD_NM = 1.0, 20.0  # more than ten waves over the torque, of which a few knots show none


def rippling(torque_nm: float, frequency_hz: float, seed: int) -> Run:
    """A run whose recorded torque lacks a ripple over the torque that the platform feels."""
    run = sine_run(torque_nm, frequency_hz, seed=seed)
    assert run.torque_nm is not None
    felt = run.torque_nm
    told = felt.copy()
    for _ in range(20):  # felt = told + ripple(told)
        told = felt - RIPPLE_NM * np.sin(2.0 * np.pi * told / PERIOD_NM)
    return replace(run, torque_nm=told)


def regression(runs: list[Run]) -> TorqueRegression:
    traces = traces_of(Recording(tuple(runs)))
    return TorqueRegression(traces, split(traces, "auto"), 60.0, scale_of(traces, TRUTH, ()))


def test_many_waves_over_the_torque_are_seen_and_the_parameters_are_right_beside_them() -> None:
    along = regression([rippling(m, f, k) for k, (m, f) in enumerate(SETS)])
    fit = along.solve(Structure(), {})
    left = disturbance_of(along, fit, along.noise_floor_nm(fit.values), "N*m")
    assert left.depends_on[0].on == "torque"
    assert left.depends_on[0].relative > 0.9 * left.relative
    curve = np.array(left.depends_on[0].shape_nm)
    assert np.max(np.abs(curve)) == pytest.approx(RIPPLE_NM, rel=0.3)


def test_nothing_is_seen_where_there_is_nothing() -> None:
    along = regression([sine_run(m, f, seed=k) for k, (m, f) in enumerate(SETS)])
    fit = along.solve(Structure(), {})
    assert disturbance_of(along, fit, along.noise_floor_nm(fit.values), "N*m").depends_on == ()


def test_it_says_nothing_about_values_that_it_has_not_seen() -> None:
    along = regression([sine_run(m, f, seed=k) for k, (m, f) in enumerate(((20.0, 1.0), (20.0, 3.0), (111.0, 1.5)))])
    fit = along.solve(Structure(), {})
    torque = along.at_rows(along.ahead("torque"))
    bump = FreeForm("torque", np.sin(torque)[:, None], np.zeros(0), np.zeros((0, 1)), over=torque)
    large = along.run_of_each == 2
    unseen = large & (np.abs(torque) > np.max(np.abs(torque[~large])))
    held = np.concatenate(along.beside(fit, bump)[0].held)
    alone = np.concatenate(fit.held)
    assert np.any(unseen) and np.allclose(held[unseen], alone[unseen], atol=1e-3 * along.torque_nm)


def test_the_squared_gains_are_the_bends_between_the_knots() -> None:
    x = np.linspace(-1.0, 1.0, 4000)
    basis, at = smooth_splines(x)
    assert basis is not None
    columns = basis(x)
    assert np.allclose(
        np.column_stack([np.ones_like(x), x]).T @ columns, 0.0, atol=1e-6 * np.abs(columns).max() * len(x)
    )
    rough = {waves: np.sin(2.0 * np.pi * waves * x) for waves in (2, 4)}
    size = {
        n: float(np.sum(np.linalg.lstsq(columns, y - np.polyval(np.polyfit(x, y, 1), x), rcond=None)[0] ** 2))
        for n, y in rough.items()
    }
    assert size[4] / size[2] == pytest.approx(16.0, rel=0.2)  # its fourth power
    assert at[0] == -1.0 and at[-1] == 1.0


def test_values_that_are_all_alike_make_no_curve() -> None:
    assert smooth_splines(np.ones(10))[0] is None


def test_a_torque_that_friction_takes_is_not_explained_by_a_curve_over_itself() -> None:
    """A square torque that goes with the direction leaves nothing to be moved, once the curve makes it a square."""
    there = {"coulomb_friction": {"level": 4.0}, "quadratic_damping": {"factor": 0.003}}
    jck = (0.005, 0.05, 0.0)
    runs = [sine_run(m, f, seed=k, effects=there, jck=jck) for k, (m, f) in enumerate(((6.0, 1.0), (6.5, 1.5)))]
    along = regression(runs)
    fit = along.solve(Structure(("inertia", "damping"), ("coulomb_friction",)), {})
    curve = next(c for c in curves(along, fit) if c.on == "torque")
    richer = along.beside(fit, curve)[0]
    assert richer.values[("inertia",)] > 0.8 * fit.values[("inertia",)]


def test_where_all_samples_are_held_out_at_once_a_curve_says_nothing() -> None:
    along = regression([sine_run(m, f, seed=k) for k, (m, f) in enumerate(SETS)])
    fit = along.solve(Structure(), {})
    along._by_run = along._by_block = [along._used]
    torque = along.at_rows(along.ahead("torque"))
    bump = FreeForm("torque", np.sin(torque)[:, None], np.zeros(0), np.zeros((0, 1)), over=torque)
    assert np.all(np.isfinite(np.concatenate(along.beside(fit, bump)[0].held)))
