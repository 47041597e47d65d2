"""What a little more of anything adds to a simulated run, against a run that is simulated with that little more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from identify.signals.prepare import prepare
from identify.simulate.linearisation import Neighbourhood, neighbourhood_of
from identify.simulate.shots import Shots, make_shots, predict
from rig.dynamics import Equations
from rig.platform import Platform
from tests.identify.simulated import TRUTH, sine_run

LITTLE = 1e-5
SMOOTH: dict[str, Mapping[str, float]] = {
    "cubic_stiffness": {"factor": 300.0},
    "quadratic_damping": {"factor": 0.03},
    "unbalance": {"sine": 8.0, "cosine": 3.0},
    "cogging": {"sine": 1.0, "cosine": -0.6, "order": 12.0},
    "stiffness_drift": {"slope": 2.0},
    "creep": {"stiffness": 20.0, "time": 0.05},
    "flexible_mode": {"inertia": 2e-3, "frequency": 55.0, "ratio": 0.02},
    "hysteresis": {"level": 2.0, "yield_angle": 0.03, "exponent": 1.5, "share": 0.4},
}
BEHIND = {"torque_delay": {"delay": 2e-3}, "sensor_lag": {"time": 1e-3}}


def platform(name: str) -> Platform:
    return Platform(*TRUTH, {name: SMOOTH[name], **BEHIND})


def around(declared: Platform, length: int | None = None) -> tuple[Neighbourhood, Shots]:
    equations = Equations(declared)
    trace = prepare(sine_run(67, 6, effects=declared.effects, duration_s=2.0))
    shots = make_shots(trace, 4, length, None, equations)
    found = neighbourhood_of(shots, equations)
    assert found is not None
    np.testing.assert_array_equal(found.channel, predict(shots, equations, shots.starts, shots.bias))
    return found, shots


def share_missed(found: np.ndarray, simulated: np.ndarray) -> float:
    return float(np.linalg.norm(found - simulated) / np.linalg.norm(simulated))


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("length", [None, 120])
def test_other_parameters(name: str, length: int | None) -> None:
    declared = platform(name)
    near, shots = around(declared, length)
    changes = [replace(declared, **{k: (1 + LITTLE) * getattr(declared, k)}) for k in
               ("inertia_kg_m2", "damping_nm_s_rad", "stiffness_nm_rad")]  # fmt: skip
    for effect, values in declared.effects.items():
        for parameter, value in values.items():
            held = {**values, parameter: (1 + LITTLE) * value}
            changes.append(replace(declared, effects={**declared.effects, effect: held}))
    told = 0
    for changed in changes:
        other = Equations(changed)
        found = near.changed(other)
        if found is None:  # internal states feel it
            assert changed.effects[name] != declared.effects[name]
            continue
        told += 1
        simulated = predict(shots, other, shots.starts, shots.bias) - near.channel
        assert share_missed(found, simulated) < 5e-3, changed
    assert told == (3 if Equations(declared).states else 3 + len(SMOOTH[name])) + len(BEHIND)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("length", [None, 120])
def test_other_starts(name: str, length: int | None) -> None:
    declared = platform(name)
    near, shots = around(declared, length)
    for k, size in enumerate((1e-5, 1e-3)):
        starts = shots.starts.copy()
        starts[:, k] += size
        simulated = predict(shots, Equations(declared), starts, shots.bias) - near.channel
        assert share_missed(near.begun(k), simulated / size) < 2e-3


@pytest.mark.parametrize("name", SMOOTH)
def test_a_torque_that_resists_besides(name: str) -> None:
    declared = platform(name)
    near, shots = around(declared)
    time = shots.grid.step_s * np.arange(shots.grid.n)
    push = 1e-3 * np.stack([np.sin(130.0 * (time + f * shots.grid.step_s)) for f in (0.0, 0.5, 1.0)], axis=1)
    simulated = predict(shots, Equations(declared), shots.starts, shots.bias, push) - near.channel
    assert share_missed(near.resisted(push), simulated) < 2e-3


FAST: dict[str, Mapping[str, float]] = {
    "presliding_friction": {"level": 0.5, "displacement": 0.002},
    "hysteresis": {"level": 0.5, "yield_angle": 0.002, "exponent": 2.0, "share": 0.5},
}


@pytest.mark.parametrize("name", FAST)
def test_on_a_servo_that_overruns_its_contact_in_every_step(name: str) -> None:
    """At 60 rad/s a fine step is many times the angle within which the contact bends."""
    declared = Platform(0.01, 0.02, 0.0, {name: FAST[name]})
    run = sine_run(4.0, 1.0, effects=declared.effects, duration_s=2.0, jck=(0.01, 0.02, 0.0))
    shots = make_shots(prepare(run), 4, None, None, Equations(declared))
    assert float(np.max(np.abs(shots.trace.measured))) > 50.0
    near = neighbourhood_of(shots, Equations(declared))
    assert near is not None
    for k, size in enumerate((1e-5, 1e-3)):
        starts = shots.starts.copy()
        starts[:, k] += size
        simulated = predict(shots, Equations(declared), starts, shots.bias) - near.channel
        assert np.max(np.abs(near.begun(k) - simulated / size)) < 5e-3 * np.max(np.abs(near.begun(1)))
    time = shots.grid.step_s * np.arange(shots.grid.n)
    push = 1e-4 * np.stack([np.sin(13.0 * (time + f * shots.grid.step_s)) for f in (0.0, 0.5, 1.0)], axis=1)
    simulated = predict(shots, Equations(declared), shots.starts, shots.bias, push) - near.channel
    assert share_missed(near.resisted(push), simulated) < 2e-2


@pytest.mark.parametrize(
    "effects", [{}, {"coulomb_friction": {"level": 1.0}}, {"backlash": {"half_gap": 1e-3}}], ids=["bare", "dry", "gap"]
)
def test_where_a_simulation_is_cheap_or_its_torque_jumps_there_is_none(effects: Mapping[str, object]) -> None:
    equations = Equations(Platform(*TRUTH, effects))
    shots = make_shots(prepare(sine_run(67, 6, duration_s=1.0)), 4, None, None, equations)
    assert neighbourhood_of(shots, equations) is None
