"""The rigs of the field bench: they know nothing of the product, and move as the product's do."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.field import library
from benchmarks.field.plant import CODES, PARAMETERS, STATES
from benchmarks.field.simulation import simulate
from rig import dynamics, effects
from rig.platform import Platform

FOLDER = Path(__file__).parents[2] / "benchmarks" / "field"
ALLOWED = {"numpy", "scipy", "numba", "h5py"}
JCK = (0.02, 0.045, 677.3)
SAMPLE_S, FINE, SAMPLES = 1e-3, 24, 3000
VALUES: dict[str, dict[str, float]] = {
    "coulomb_friction": {"level": 1.2},
    "stribeck_friction": {"coulomb": 1.2, "static": 2.4, "speed": 0.08},
    "presliding_friction": {"level": 1.0, "displacement": 0.004},
    "load_dependent_friction": {"factor": 0.013},
    "quadratic_damping": {"factor": 0.02},
    "directional_damping": {"step": 0.05},
    "cubic_stiffness": {"factor": 500.0},
    "quadratic_stiffness": {"factor": -100.0},
    "bilinear_stiffness": {"step": 30.0},
    "backlash": {"half_gap": 0.003},
    "hysteresis": {"level": 2.0, "yield_angle": 0.02, "exponent": 1.7, "share": 0.6},
    "creep": {"stiffness": 30.0, "time": 0.1},
    "stiffness_drift": {"slope": 5.0},
    "unbalance": {"sine": 10.0, "cosine": 20.0},
    "cogging": {"sine": 0.5, "cosine": 0.3, "order": 40.0},
    "torque_delay": {"delay": 0.00277},
    "actuator_lag": {"time": 0.0023},
    "torque_saturation": {"limit": 20.0},
    "torque_deadzone": {"width": 0.7},
    "torque_offset": {"level": 1.1},
    "flexible_mode": {"inertia": 0.003, "frequency": 40.0, "ratio": 0.02},
    "periodic_disturbance": {"sine": 0.5, "cosine": 0.3, "frequency": 13.3},
}


def torque_nm() -> Any:
    """Three tones that grow from nothing, held from sample to sample."""
    t = SAMPLE_S * np.arange(SAMPLES)
    return np.minimum(1.0, t) * sum(a * np.sin(2 * np.pi * f * t + f) for a, f in ((20, 2.1), (14, 7.3), (9, 17.9)))


def of_the_bench(name: str) -> Any:
    """Angle at the samples, rad."""
    given = VALUES[name] if name else {}
    names = [name] if name else []
    states = 2 + (STATES.get(name, 0) if name else 0)
    p = np.array([given[k] for k in PARAMETERS[name]] if name else [0.0])
    n = FINE * SAMPLES
    asked = np.stack([np.repeat(torque_nm(), FINE), np.zeros(n)], axis=1)
    out, _ = simulate(
        SAMPLE_S / FINE, 0, np.array(JCK), np.array([CODES[x] for x in names], dtype=np.int64),
        np.full(len(names), 2, dtype=np.int64), np.zeros(len(names), dtype=np.int64), p,
        given.get("delay", 0.0), np.array([0.0, 0.0, 0.0, 0.0, 1e-9, 0.0, 0.0]), asked, np.ones(n, dtype=np.bool_),
        np.zeros(n), 0.0, states, "friction" in name and name != "presliding_friction",
    )  # fmt: skip
    return out[:-1:FINE, 0]


def of_the_product(name: str) -> Any:
    t = SAMPLE_S * np.arange(SAMPLES)
    torque = dynamics.TorqueSignal(t, torque_nm(), "zero_order")
    given = {name: VALUES[name]} if name else {}
    return dynamics.simulate(Platform(*JCK, given), t, torque, substeps=FINE).angle_rad


@pytest.mark.parametrize("name", sorted(VALUES))
def test_the_bench_and_the_product_move_the_same_rig_alike(name: str) -> None:
    mine, theirs = of_the_bench(name), of_the_product(name)
    changed = np.sqrt(np.mean((theirs - of_the_product("")) ** 2))
    assert np.sqrt(np.mean((mine - theirs) ** 2)) < 0.01 * changed


def test_every_effect_that_enters_the_motion_is_compared_and_named_as_the_product_does() -> None:
    assert set(VALUES) == set(library.LIBRARY) - {"sensor_lag"}
    for name in library.LIBRARY:
        assert PARAMETERS[name] == tuple(p.name for p in effects.get(name).parameters)
    assert set(library.EVERYTHING) == set(PARAMETERS)
    assert not set(library.OUTSIDE) & set(effects.names())


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda p: p.name)
def test_the_bench_imports_nothing_of_the_product(path: Path) -> None:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    outside = {n.split(".")[0] for n in found if not n.startswith("benchmarks.field")}
    assert outside - set(sys.stdlib_module_names) <= ALLOWED
