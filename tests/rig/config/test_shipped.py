"""The configurations that come with the project do what their comments promise."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.config.excitation import PAPER_SETS
from rig.config.load import load_config
from rig.config.root import Config
from rig.excitation import Sine
from rig.preflight import plan
from sim_backend.simulated import SimulatedRig

ROOT = Path(__file__).parents[3]
PLAYED = ("rig.yaml", "examples/table1.yaml", "examples/table2.yaml")
TERMS = ("inertia_kg_m2", "damping_nm_s_rad", "stiffness_nm_rad")


def shipped(name: str) -> Config:
    return load_config(ROOT / name).config


@pytest.mark.parametrize("name", PLAYED)
def test_it_asks_for_the_five_sets_of_the_paper(name: str) -> None:
    sets = shipped(name).excitation.sets
    assert [(s.torque_nm, s.frequency_hz) for s in sets if isinstance(s, Sine)] == list(PAPER_SETS)


@pytest.mark.parametrize("name", PLAYED)
def test_its_forecast_lets_every_set_pass(name: str) -> None:
    config = shipped(name)
    rig = SimulatedRig(config.simulated, config.excitation.sample_rate_hz)
    sets = plan(config.model.platform(), config.excitation, config.limits, rig.rate_full_scale_rad_s)
    scaled = [s.scale < 1.0 for s in sets]
    assert scaled == ([True] * 5 if name == "rig.yaml" else [False] * 5)


@pytest.mark.parametrize("name", PLAYED)
def test_what_it_declares_is_not_the_truth_it_hides(name: str) -> None:
    config = shipped(name)
    declared, truth = config.model, config.simulated.platform
    for term in TERMS:
        assert abs(getattr(declared, term) / getattr(truth, term) - 1.0) > 0.04
    assert not declared.effects


def test_the_default_hides_a_friction_and_a_small_delay() -> None:
    effects = shipped("rig.yaml").simulated.platform.effects
    assert set(effects) == {"coulomb_friction", "torque_delay"}
    assert 0 < effects["torque_delay"]["delay"] <= 1e-3


def test_table_1_is_the_papers_simulation() -> None:
    config = shipped("examples/table1.yaml")
    genetic, truth = config.identify.genetic, config.simulated.platform
    assert (genetic.population, genetic.generations) == (100, 200)
    assert (genetic.crossover_probability, genetic.mutation_probability) == (0.7, 0.1)
    assert tuple(getattr(truth, t) for t in TERMS) == (0.02, 0.045, 677.3)
    assert config.simulated.amplifier.kind == "ideal"
    assert config.simulated.gyro.noise_deg_s == 0.05
    assert not truth.effects


def test_table_2_is_the_papers_experiment_with_the_friction_of_equation_7() -> None:
    config = shipped("examples/table2.yaml")
    genetic, truth = config.identify.genetic, config.simulated.platform
    assert (genetic.population, genetic.generations) == (500, 600)
    assert (genetic.crossover_probability, genetic.mutation_probability) == (0.8, 0.05)
    assert tuple(getattr(truth, t) for t in TERMS) == (0.0202, 0.0454, 674.325)
    friction = truth.effects["stribeck_friction"]
    assert friction["coulomb"] >= 0.01 * 300
    assert friction["static"] >= 1.5 * friction["coulomb"]
    assert friction["speed"] <= 0.1


@pytest.mark.parametrize("name", PLAYED[1:])
def test_the_reference_of_equation_15_is_the_truth(name: str) -> None:
    config = shipped(name)
    reference = config.identify.reference
    assert reference is not None
    assert all(getattr(reference, t) == getattr(config.simulated.platform, t) for t in TERMS)
