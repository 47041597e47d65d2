"""The exported compensation: what it holds, that C and Python agree, and that both are what the effects are."""

from __future__ import annotations

import csv
import ctypes
import io
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identify.model.effect_torque import torque_along
from identify.proof.controller import Controller, controller_of, value
from identify.proof.controller_code import files
from rig import effects
from rig.effects.base import Place
from rig.errors import UsageError
from rig.recording.run import Recording, Run
from tests.identify.proof.test_compensation import with_effects

GIVEN: dict[str, dict[str, float]] = {
    "stribeck_friction": {"coulomb": 1.0, "static": 1.3, "speed": 0.05},
    "load_dependent_friction": {"factor": 0.03},
    "quadratic_damping": {"factor": 0.01},
    "directional_damping": {"step": 0.02},
    "cubic_stiffness": {"factor": 1000.0},
    "quadratic_stiffness": {"factor": 150.0},
    "bilinear_stiffness": {"step": 20.0},
    "backlash": {"half_gap": 1e-3},
    "unbalance": {"sine": 10.0, "cosine": 2.0},
    "cogging": {"sine": 0.5, "cosine": 0.3, "order": 40.0},
    "torque_offset": {"level": 0.4},
    "coulomb_friction": {"level": 1.1},
}
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def recording(most_rad: float = 0.15, hz: float = 2.0) -> Recording:
    time_s = np.arange(0.0, 2.0, 1e-3)
    rate = most_rad * 2.0 * math.pi * hz * np.cos(2.0 * math.pi * hz * time_s)
    return Recording((Run("a", time_s, np.ones(len(time_s), dtype=bool), rate_rad_s=rate),))


def of_all() -> Controller:
    return controller_of(with_effects(**GIVEN), recording(), 150.0)


def module(text: str) -> Any:
    names: dict[str, Any] = {}
    exec(text, names)
    return names["Compensation"]()


@pytest.mark.parametrize("name", GIVEN)
def test_a_formula_is_what_the_kernel_computes(name: str) -> None:
    effect = effects.get(name)
    model = with_effects(**{name: GIVEN[name]})
    made = controller_of(model, recording(), 1e6)
    p = np.array([model.inertia_kg_m2, model.damping_nm_s_rad, model.stiffness_nm_rad, *effect.values(GIVEN[name])])
    for angle, rate, torque in ((0.1, 0.7, 20.0), (-0.08, -0.3, -35.0), (0.0005, 1.2, 5.0)):
        out, one = np.zeros(1), np.ones(1)
        moving = abs(rate) if effect.place is Place.FRICTION else rate
        torque_along(
            effect.kernel.address, angle * one, moving * one, 0 * one, torque * one, 1.0, np.zeros(0), 1, p, False, 1.0,
            out,
        )  # fmt: skip
        sign = math.copysign(1.0, rate) if effect.place is Place.FRICTION else 1.0
        assert value(made, angle, rate, torque) == pytest.approx(sign * out[0], rel=1e-12, abs=1e-12)


def test_every_effect_without_memory_on_the_shaft_has_a_formula() -> None:
    for name in effects.names():
        effect = effects.get(name)
        memoryless = effect.place in (Place.LOAD, Place.FRICTION) and not effect.states and effect.foreseen
        assert bool(effect.formula) == memoryless, name
    assert set(GIVEN) == {name for name in effects.names() if effects.get(name).formula}  # what is compiled below


def test_c_compiles_without_a_warning_and_agrees_with_python(tmp_path: Path) -> None:
    if COMPILER is None:
        pytest.skip("no C compiler on this machine")
    known = of_all()
    made = files(known)
    for name, text in made.items():
        (tmp_path / name).write_text(text, encoding="ascii")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O2", "-shared", "-fPIC"]
    done = subprocess.run(
        [COMPILER, *strict, "-o", "compensation.so", "compensation.c", "-lm"], cwd=tmp_path, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0 and not done.stderr, done.stderr
    in_c = ctypes.CDLL(str(tmp_path / "compensation.so")).compensation_nm
    in_c.restype, in_c.argtypes = ctypes.c_double, [ctypes.c_double] * 3
    in_python, rng = module(made["compensation.py"]), np.random.default_rng(5)
    for angle, rate, torque in rng.uniform((-0.3, -4.0, -100.0), (0.3, 4.0, 100.0), (2000, 3)).tolist():
        assert abs(in_c(angle, rate, torque) - in_python.torque_nm(angle, rate, torque)) < 1e-9
        assert abs(in_python.torque_nm(angle, rate, torque) - value(known, angle, rate, torque)) < 1e-9
    for bad in (np.nan, np.inf, -np.inf):  # a lost sample is no reason to push as hard as is allowed
        for inputs in ((bad, 1.0, 1.0), (0.1, bad, 1.0), (0.1, 1.0, bad)):
            assert in_c(*inputs) == in_python.torque_nm(*inputs) == 0.0


def test_each_effect_alone_compiles_without_a_warning(tmp_path: Path) -> None:
    if COMPILER is None:
        pytest.skip("no C compiler on this machine")
    for name, given in GIVEN.items():
        for file, text in files(controller_of(with_effects(**{name: given}), recording(), 150.0)).items():
            (tmp_path / file).write_text(text, encoding="ascii")
        line = [COMPILER, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", "compensation.c"]
        done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{name}: {done.stderr}"


def test_beyond_what_was_identified_the_value_there_is_kept_and_the_limit_never_exceeded() -> None:
    made = controller_of(with_effects(cubic_stiffness={"factor": 1000.0}), recording(0.15), 150.0)
    assert made.most_angle_rad == pytest.approx(0.15, rel=0.05)
    assert value(made, 9.0, 0.0) == value(made, made.most_angle_rad, 0.0) > 0.0
    low = controller_of(with_effects(coulomb_friction={"level": 5.0}), recording(), 2.0)
    assert value(low, 0.0, 1.0) == 2.0 and value(low, 0.0, -1.0) == -2.0


def test_what_is_no_function_of_angle_and_rate_is_said() -> None:
    model = with_effects(
        coulomb_friction={"level": 1.0}, torque_delay={"delay": 1e-3}, creep={"stiffness": 9.0, "time": 1.0}
    )
    made = controller_of(model, recording(), 100.0)
    assert set(made.left_out) == {"torque_delay", "creep"}
    assert "Not included: torque delay" in files(made)["compensation.h"]
    with pytest.raises(UsageError, match="function of angle, rate and torque: torque_delay: its compensation inverts"):
        controller_of(with_effects(torque_delay={"delay": 1e-3}), recording(), 100.0)


def test_the_table_holds_the_values_of_the_function_and_names_the_model() -> None:
    made = of_all()
    text = files(made)["compensation.csv"]
    assert made.version in text and f"up to {made.most_angle_rad:.4g} rad" in text
    rows = list(csv.DictReader(io.StringIO("\n".join(line for line in text.splitlines() if not line.startswith("#")))))
    assert len(rows) == 41 * 41
    for row in rows[::97]:
        angle, rate, torque = (float(row[k]) for k in ("angle_rad", "rate_rad_s", "compensation_nm"))
        assert torque == value(made, angle, rate)


def test_another_model_has_another_version() -> None:
    models = [with_effects(coulomb_friction={"level": level}) for level in (1.0, 1.1)]
    assert len({controller_of(model, recording(), 9.0).version for model in models}) == 2
