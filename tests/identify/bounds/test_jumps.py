"""An effect whose torque jumps at a parameter has no interval there, and is told so with the cure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identify.bounds.jumps import why_of_a_jump
from identify.estimate.final_fit import FinalFit
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from rig import effects
from rig.effects import _outside
from tests.identify.bounds.given_fit import final_fit
from tests.identify.simulated import sine_run

KERNEL = """
import math
from rig.effects import Effect, Parameter, Place, kernel

@kernel
def step(angle, rate, time, torque, state, dstate, p):
    return {torque}

EFFECT = Effect(
    name="step_at_angle", family="restoring torque", place=Place.LOAD, equation="T = level where th > where",
    source="a test", meaning="A constant torque beyond an angle.", sign="Against the angle.",
    parameters=(
        Parameter("level", "N*m", "torque", linear=True),
        Parameter("where", "rad", "where it begins", low=-0.2, high=0.2, start=lambda scale: (0.1,)),
    ),
    kernel=step, separated_by="from a spring: move far and near",
)
"""
JUMP, SLOPE = "p[3] if angle > p[4] else 0.0", "p[3] * 0.5 * (1.0 + math.tanh((angle - p[4]) / 1e-3))"


@pytest.fixture(autouse=True)
def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one test reads, the next must not know."""
    monkeypatch.setattr(_outside, "_FILES", {})


def fitted(folder: Path, torque: str) -> FinalFit:
    """A fit with the effect whose kernel returns ``torque``."""
    path = folder / "step.py"
    path.write_text(KERNEL.format(torque=torque), encoding="utf-8")
    effects.read_file(path)
    values: dict[Name, float] = {
        ("inertia",): 0.02, ("stiffness",): 650.0, ("step_at_angle", "level"): 3.0, ("step_at_angle", "where"): 0.02
    }  # fmt: skip
    structure = Structure(("inertia", "stiffness"), ("step_at_angle",))
    return replace(final_fit(structure, values, np.eye(4)), determined=(True, True, True, False))


def test_a_jump_is_said_to_be_the_reason_with_its_cure(tmp_path: Path) -> None:
    found, traces = fitted(tmp_path, JUMP), [prepare(sine_run(40.0, 1.0, duration_s=2.0), 0, 1e-3)]
    why = why_of_a_jump(found, ("step_at_angle", "where"), traces)
    assert "jumps" in why and "tanh" in why
    assert why_of_a_jump(found, ("step_at_angle", "level"), traces) == ""
    assert why_of_a_jump(found, ("stiffness",), traces) == ""


def test_a_slope_however_steep_is_no_jump(tmp_path: Path) -> None:
    traces = [prepare(sine_run(40.0, 1.0, duration_s=2.0), 0, 1e-3)]
    assert why_of_a_jump(fitted(tmp_path, SLOPE), ("step_at_angle", "where"), traces) == ""


def test_a_jump_where_the_platform_never_was_is_not_blamed(tmp_path: Path) -> None:
    traces = [prepare(sine_run(0.01, 1.0, duration_s=2.0), 0, 1e-3)]
    assert why_of_a_jump(fitted(tmp_path, JUMP), ("step_at_angle", "where"), traces) == ""
