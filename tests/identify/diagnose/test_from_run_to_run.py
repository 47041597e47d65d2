"""A model that does not hold gives other numbers in every run, though no curve over one quantity shows it."""

from __future__ import annotations

import numpy as np
import pytest

from identify.conclude.headline import headline
from identify.conclude.next_steps import next_steps
from identify.diagnose.coloured_residual import combined
from identify.diagnose.disturbance import _dependence, disturbance_of
from identify.diagnose.terms.from_run_to_run import between_runs
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.model.structure import Structure
from identify.pipeline import identify
from identify.residual import FROM_RUN_TO_RUN
from identify.results import Identification
from identify.runs.holdout import split
from rig.config.identify import IdentifyConfig
from rig.platform import Platform
from rig.recording.run import Recording, Run
from tests.identify.simulated import traces_of

INERTIA, DAMPING, STIFFNESS = 0.025, 0.3, 470.0
SWINGS = ((0.5, 0.14), (1.0, 0.12), (3.0, 0.14), (6.0, 0.12), (10.0, 0.1), (14.0, 0.12))  # Hz, rad


def swung(number: int, hz: float, travel_rad: float, bent: float) -> Run:
    """Two sines, far below the resonance or about it, read by a gyro that reads w + ``bent`` w^3, and their torque."""
    rng = np.random.default_rng(number)
    time = np.arange(3001) * 1e-3
    angle, rate, acceleration = np.zeros((3, len(time)))
    for size, factor in ((travel_rad, 1.0), (0.3 * travel_rad, 2.3)):
        w, phase = 2.0 * np.pi * hz * factor, rng.uniform(0.0, 2.0 * np.pi)
        angle += size * np.sin(w * time + phase)
        rate += size * w * np.cos(w * time + phase)
        acceleration -= size * w**2 * np.sin(w * time + phase)
    torque = INERTIA * acceleration + DAMPING * rate + STIFFNESS * angle
    torque = torque + 5e-4 * np.std(torque) * rng.standard_normal(len(time))
    read = rate + bent * rate**3 + 2e-3 * rng.standard_normal(len(time))
    return Run(f"{hz:g} Hz", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time, torque_nm=torque)


def runs_of(bent: float) -> tuple[Run, ...]:
    return tuple(swung(k, hz, travel, bent) for k, (hz, travel) in enumerate(SWINGS))


def identified(bent: float) -> Identification:
    declared = Platform(0.023, 0.35, 460.0)
    return identify(Recording(runs_of(bent)), declared, IdentifyConfig(candidates=("coulomb_friction",)))


@pytest.mark.slow
def test_a_gyro_whose_scale_bends_makes_the_runs_differ_and_the_result_is_refused() -> None:
    found = identified(4e-4)
    assert found.disturbance is not None
    assert FROM_RUN_TO_RUN in [d.changes for d in found.disturbance.depends_on]
    assert not found.accepted
    assert found.verdict.unexplained
    said = " ".join((*found.verdict.sentences, *found.reasons))
    assert "depends on the run (J, C and K fitted to each run by itself differ)" in said
    assert headline(found)[0].startswith("The declared model does not hold for all runs")
    assert any("at half and at twice the torque" in step for step in next_steps(found))


@pytest.mark.slow
@pytest.mark.parametrize(("bent", "differ"), [(4e-4, True), (0.0, False)])
def test_in_torque_the_runs_differ_where_the_scale_bends_and_only_there(bent: float, differ: bool) -> None:
    traces = traces_of(Recording(runs_of(bent)))
    scale = scale_of(traces, (INERTIA, DAMPING, STIFFNESS), ())
    along = TorqueRegression(traces, split(traces, "auto"), 60.0, scale)
    fit = along.solve(Structure(), {})
    found = _dependence(along, fit, between_runs(along, fit)[0])
    assert (found is not None) is differ
    moved = found[1].get(("inertia",), 0.0) if found else 0.0
    assert (abs(moved) > 0.02 * INERTIA) is differ
    assert bool(disturbance_of(along, fit, along.noise_floor_nm(fit.values), "N*m").depends_on) is differ


@pytest.mark.slow
def test_a_gyro_that_is_straight_does_not() -> None:
    found = identified(0.0)
    assert found.accepted, found.reasons
    assert found.disturbance is None or FROM_RUN_TO_RUN not in [d.changes for d in found.disturbance.depends_on]
    assert found.final.parameters["inertia"].value == pytest.approx(INERTIA, rel=5e-3)


def test_a_run_that_knows_little_does_not_hide_that_others_gain() -> None:
    rng = np.random.default_rng(1)
    quiet = [rng.normal(0.0, 1.0, 24) for _ in range(8)]
    assert combined([*quiet, rng.normal(3.0, 1.0, 24)]) > 4.0
    assert combined(quiet) < 3.0


def test_error_rates_of_runs_combine_to_what_they_are() -> None:
    rng = np.random.default_rng(2)
    found = np.array([combined([rng.normal(0.0, 1.0, 24) for _ in range(5)]) for _ in range(2000)])
    assert np.mean(found > 2.0) == pytest.approx(0.0228, abs=0.01)
