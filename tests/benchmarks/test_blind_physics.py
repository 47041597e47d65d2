"""The platform of the blind bench: knows nothing of the product, and moves as the product's does."""

from __future__ import annotations

import ast
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks.blind import cases, library
from benchmarks.blind.excitations import Excitation, multisine, read, sine
from benchmarks.blind.hidden import ORDER, Hidden
from benchmarks.blind.play import play
from rig import effects
from rig.config.excitation import ExcitationConfig
from rig.dynamics import TorqueSignal, simulate
from rig.excitation import planned
from rig.platform import Platform

FOLDER = Path(__file__).parents[2] / "benchmarks" / "blind"
ALLOWED = {"numpy", "scipy", "numba", "h5py", "yaml", "benchmarks"}
SIGMA = math.radians(0.05)
JCK = (0.02, 0.045, 677.3)
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
    "stiffness_drift": {"slope": 1.7},
    "unbalance": {"sine": 10.0, "cosine": 20.0},
    "cogging": {"sine": 0.5, "cosine": 0.3, "order": 40.0},
    "torque_delay": {"delay": 0.00077},
    "actuator_lag": {"time": 0.0013},
    "torque_saturation": {"limit": 40.0},
    "torque_deadzone": {"width": 0.7},
    "torque_offset": {"level": 1.1},
    "flexible_mode": {"inertia": 0.003, "frequency": 40.0, "ratio": 0.02},
    "sensor_lag": {"time": 0.0017},
    "rate_bias": {"bias": 0.02},
    "periodic_disturbance": {"amplitude": 0.5, "frequency": 13.3},
}


@cache
def sets() -> tuple[Excitation, ...]:
    """Made when they are asked for: what draws them is compiled."""
    return sine(111.0, 1.0, 2.0), sine(42.0, 9.0, 2.0), multisine(60.0, (2.0, 7.0, 13.0, 19.0), 2.0, 0.5, 4)


def imported(path: Path) -> set[str]:
    """Packages that a file imports, wherever in the file, save from the standard library."""
    import sys  # noqa: PLC0415

    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    found = {n for n in names if not n.startswith("benchmarks.blind")}
    return {n.split(".")[0] for n in found} - set(sys.stdlib_module_names)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda p: p.name)
def test_the_bench_imports_nothing_of_the_product(path: Path) -> None:
    assert imported(path) <= ALLOWED - {"benchmarks"}


def test_every_effect_of_the_product_can_be_hidden() -> None:
    # What only shows where a known inertia was added is hidden as a kind of case, not as an effect.
    nameable = [n for n in effects.names() if not effects.get(n).needs_added_inertia]
    assert set(library.LIBRARY) == set(nameable) == set(VALUES)
    for name in nameable:
        if name != "periodic_disturbance":  # the bench draws a phase where the product fits sine and cosine
            assert ORDER[name] == tuple(p.name for p in effects.get(name).parameters)
    assert not set(library.OUTSIDE) & set(effects.names())


@pytest.mark.parametrize("name", sorted(VALUES))
def test_the_bench_and_the_product_move_the_same_platform_alike(name: str) -> None:
    hidden = Hidden(*JCK, {name: VALUES[name]}, phase_seed=3)
    for number, (excitation, record) in enumerate(zip(sets(), hidden.play(sets()), strict=True)):
        given, start = {name: VALUES[name]}, (hidden.rest_angle() + hidden.stuck_rad(number), 0.0)
        if name == "periodic_disturbance":
            v, phase = VALUES[name], hidden._phase(number)
            parts = {"sine": v["amplitude"] * math.cos(phase), "cosine": v["amplitude"] * math.sin(phase)}
            given = {name: {**parts, "frequency": v["frequency"]}}
        torque = TorqueSignal(record.time_s, record.torque_nm)
        motion = simulate(Platform(*JCK, given), record.time_s, torque, start=start, substeps=24)
        # The product knows the torque at its samples only: a kink between two of them costs a little.
        assert np.abs(motion.sensed_rate_rad_s - record.sensed_rate_rad_s).max() < 0.05 * SIGMA, excitation.name


@pytest.mark.parametrize("name", ["cubic_stiffness", "backlash", "flexible_mode", "actuator_lag", "torque_deadzone"])
def test_halving_the_step_changes_nothing(name: str) -> None:
    hidden = Hidden(*JCK, {name: VALUES[name]})
    coarse, fine = hidden._one(sets()[1], 0), hidden._one(sets()[1], 0, substeps=8)
    assert fine.rate_rad_s == pytest.approx(coarse.rate_rad_s, abs=1e-9)


def test_dry_friction_holds_the_platform_until_the_torque_exceeds_it() -> None:
    hidden = Hidden(*JCK, {"coulomb_friction": {"level": 5.0}})
    spring = JCK[2] * hidden.stuck_rad(0)  # it begins where friction holds it
    assert 0.0 < abs(spring) < 0.9 * 5.0
    (held,) = hidden.play([sine(0.99 * (5.0 - abs(spring)), 1.0, 2.0)])
    assert not np.any(held.rate_rad_s)
    assert held.parts[:, 0] == pytest.approx(held.torque_nm - spring, abs=1e-9)
    (moved,) = hidden.play([sine(20.0, 1.0, 2.0)])
    breaks = math.asin((5.0 + spring) / 20.0) / (2.0 * math.pi)
    assert moved.time_s[np.flatnonzero(moved.rate_rad_s)[0]] == pytest.approx(breaks, abs=1.1e-3)


def test_an_excitation_file_is_played_as_the_product_would(tmp_path: Path) -> None:
    sets = [
        {
            "kind": "sine",
            "torque_nm": 50,
            "frequency_hz": 3,
            "duration_s": 2,
            "soft_start_s": 0.5,
            "repeat_scales": [0.4],
        },
        {"kind": "multisine", "torque_nm": 40, "from_hz": 1, "to_hz": 30, "tones": 9, "duration_s": 3},
        {"kind": "multisine", "torque_nm": 40, "frequencies_hz": [2, 5, 11], "phases": "random", "seed": 5},
        {"kind": "chirp", "torque_nm": 20, "from_hz": 0.5, "to_hz": 20, "duration_s": 4, "soft_start_s": 1},
        {"kind": "chirp", "torque_nm": 20, "from_hz": 0.5, "to_hz": 20, "duration_s": 4, "sweep": "logarithmic"},
        {"kind": "ramp_hold_release", "torque_nm": 60, "ramp_s": 1, "hold_s": 0.5, "release_s": 2, "cycles": 2},
        {"kind": "free_decay", "torque_nm": 60, "pull_s": 1, "hold_s": 0.5, "duration_s": 4, "travel_cap_deg": 3},
    ]
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump({"excitation": {"sets": sets}}), encoding="utf-8")
    mine, rate_hz = read(tmp_path / "plan.yaml")
    theirs = planned(ExcitationConfig.model_validate({"sets": sets}).sets)
    assert rate_hz == 1000.0
    for one, other in zip(mine, theirs, strict=True):
        t = one.times(1e-3)
        assert one.torque(t) == pytest.approx(other.torque(t), abs=0.1 * 0.01)
    played, records = play(Hidden(*JCK), mine)
    assert math.degrees(np.abs(records[-1].angle_rad).max()) <= 3.0
    assert played[-1].numbers[0] < mine[-1].numbers[0]


def test_friction_that_the_torque_presses_turns_on_time_behind_a_dead_zone() -> None:
    hidden = {"load_dependent_friction": {"factor": 0.057}, "torque_deadzone": {"width": 2.9}}
    numbers = (0.044, 0.28, 641.0, hidden)
    found = Hidden(*numbers).play([sine(26.0, 0.7, 3.0)])[0]
    asked = TorqueSignal(found.time_s, found.torque_nm)
    ours = simulate(Platform(*numbers), found.time_s, asked, substeps=32)
    assert np.std(found.rate_rad_s - ours.rate_rad_s) < 0.3 * cases.NOISE[0]


def test_friction_that_lets_go_beside_another_switch_of_the_rate_lets_go_on_time() -> None:
    hidden = {"directional_damping": {"step": 1.7}, "load_dependent_friction": {"factor": 0.05}}
    platform = Hidden(0.026, 0.1, 445.0, hidden)
    found = platform.play([sine(26.0, 6.0, 1.0)])[0]
    asked = TorqueSignal(found.time_s, found.torque_nm)
    ours = simulate(Platform(0.026, 0.1, 445.0, hidden), found.time_s, asked, substeps=32)
    assert np.max(np.abs(found.rate_rad_s - ours.rate_rad_s)) < 1e-6
