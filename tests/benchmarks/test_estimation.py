"""The benchmarks of the estimates in miniature: the same code, a campaign or two instead of hundreds."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform

FOLDER = Path(__file__).parents[2] / "benchmarks"
GYRO = Path(__file__).parents[3] / "shared" / "data" / "adis16405_gyro" / "gyro_counts.npz"


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module


def test_the_closed_form_of_the_benchmarks_is_the_motion_that_the_project_simulates(load: Any) -> None:
    campaigns: ModuleType = load("campaigns")
    t = campaigns.times(1.0)
    torque = TorqueSignal(t, 111.0 * np.sin(2.0 * math.pi * 3.0 * t))
    effects = {"torque_delay": {"delay": 7e-4}}
    for delay, platform in ((0.0, Platform()), (7e-4, Platform(effects=effects))):
        simulated = simulate(platform, t, torque, substeps=16).rate_rad_s
        assert simulated == pytest.approx(campaigns.sine_rate(t, 111.0, 3.0, delay), abs=0.01 * campaigns.SIGMA_RAD_S)


@pytest.mark.parametrize("delay", [pytest.param(False, marks=pytest.mark.slow), True])  # the model with more in it
def test_one_campaign_lands_within_a_few_bounds_of_the_truth(load: Any, delay: bool) -> None:
    efficiency: ModuleType = load("efficiency")
    off = np.abs(efficiency.errors(delay, 1, seed=3)[0])
    bounds = efficiency.bounds(delay)
    limit = np.array([[b.relative(n) for n in b.names] for b in bounds])
    assert off.shape == limit.shape == (6, 4 if delay else 3)
    assert np.all(off < 5.0 * limit)
    assert np.all(limit >= np.array([[b.if_known().relative(n) for n in b.names] for b in bounds]))


@pytest.mark.slow
def test_twenty_campaigns_are_efficient(load: Any) -> None:
    rows = load("efficiency").compare(False, 20)
    assert all(row.ratio < 1.6 for row in rows)


def test_intervals_hold_where_samples_are_lost(load: Any) -> None:
    intervals: ModuleType = load("intervals")
    found = intervals.measure("lost", load("campaigns").white, 2, lost=True)
    assert all(0.0 < spread < 4.0 for spread in found.spread.values())
    assert "| lost | 2 |" in intervals.text([found])


@pytest.mark.skipif(not GYRO.exists(), reason="the record of a real gyro is not beside this checkout")
def test_real_gyro_noise_has_the_size_of_the_white_one(load: Any) -> None:
    stretches = load("intervals").gyro_noise(GYRO)(np.random.default_rng(1))
    assert len(stretches) == 5
    assert np.mean([np.std(s) for s in stretches]) == pytest.approx(math.radians(0.05), rel=0.15)


@pytest.mark.parametrize(
    ("arrays", "said"),
    [({"counts": np.zeros((20_000, 3))}, "has no array gyro_counts"), ({"gyro_counts": np.zeros((50, 3))}, "(50, 3)")],
)
def test_a_gyro_record_that_cannot_be_used_is_refused_with_what_is_needed(
    load: Any, tmp_path: Path, arrays: dict[str, Any], said: str
) -> None:
    path = tmp_path / "gyro.npz"
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=re.escape(said)):
        load("intervals").gyro_noise(path)


@pytest.mark.parametrize("delay_ms", [*(pytest.param(d, marks=pytest.mark.slow) for d in (0.0, 0.137)), 2.5])
def test_a_delay_is_recovered_within_two_microseconds(load: Any, delay_ms: float) -> None:
    row = load("delays").measure(delay_ms, 1)
    assert row.rms_us < 2.0
    assert row.worst_percent["damping"] < 3.0


def test_the_events_of_stick_and_slip_agree_with_the_projects_integrator(load: Any) -> None:
    stick_slip: ModuleType = load("stick_slip")
    campaigns: ModuleType = load("campaigns")
    t = campaigns.times(0.6)
    by_events = stick_slip.StickSlip(0.02, 0.045, 677.3, 1.2, 2.4, 0.08).rate(
        lambda at: 60.0 * math.sin(2.0 * math.pi * at), t
    )
    friction = {"stribeck_friction": {"coulomb": 1.2, "static": 2.4, "speed": 0.08}}
    torque = TorqueSignal(t, 60.0 * np.sin(2.0 * math.pi * t))
    simulated = simulate(Platform(effects=friction), t, torque, substeps=16).rate_rad_s
    assert np.any(by_events[1:] == 0.0)  # it did stick
    assert np.sqrt(np.mean((simulated - by_events) ** 2)) < 0.05 * campaigns.SIGMA_RAD_S


def test_the_integrator_by_events_shares_nothing_with_the_project() -> None:
    lines = (FOLDER / "stick_slip.py").read_text(encoding="utf-8").splitlines()
    imported = [line.split()[1].split(".")[0] for line in lines if line.startswith(("import ", "from "))]
    assert not {"rig", "identify", "sim_backend", "drivers", "campaigns"} & set(imported)


@pytest.mark.slow
def test_the_declared_stribeck_model_reaches_the_noise(load: Any) -> None:
    stribeck: ModuleType = load("stribeck")
    fit = stribeck.fit(stribeck.recording(stribeck.rates(), 0), 3.0)
    assert fit.passes, fit


def test_the_genetic_algorithm_ends_on_the_closed_form(load: Any) -> None:
    assert max(load("genetic_gap").linear_gaps(1).values()) < 0.01


def test_the_genetic_algorithm_finds_the_shape_that_local_searches_find(load: Any) -> None:
    gap = load("genetic_gap").shape_gap("backlash", duration_s=1.0, searches=5)
    assert gap.percent < 0.1


def test_the_simulation_given_to_the_peers_is_right_to_a_tenth_of_the_noise(load: Any) -> None:
    peers: ModuleType = load("peers")
    campaigns: ModuleType = load("campaigns")
    rates = campaigns.clean_rates(peers.DELAY_S)
    simulation = peers.Simulation(campaigns.traces_from(rates, [np.zeros_like(r) for r in rates]))
    theta = np.array([*campaigns.TRUTH.values(), peers.DELAY_S])
    off = simulation.residual(theta, np.zeros((len(rates), peers.NUISANCES)))
    assert np.sqrt(np.mean(off**2)) < 0.1 * campaigns.SIGMA_RAD_S


def test_a_peer_that_is_not_installed_is_said_to_be_missing(load: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    peers: ModuleType = load("peers")
    monkeypatch.setitem(peers.TOOLS, "absent", (peers.ours, "a_package_that_does_not_exist"))
    assert "not installed" in peers.line(peers.measure("absent", False, False, 1))
