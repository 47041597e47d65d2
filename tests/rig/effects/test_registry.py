"""The registry is complete, and each effect says all that docs, report and files need from it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rig import effects
from rig.config.effects import check_effects
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.effects import Place, Scale
from rig.platform import Platform
from tests.rig.effects.values import VALUES

PROMISED = {
    "coulomb_friction", "stribeck_friction", "presliding_friction", "load_dependent_friction", "quadratic_damping",
    "directional_damping", "cubic_stiffness", "quadratic_stiffness", "bilinear_stiffness", "backlash", "hysteresis",
    "creep", "stiffness_drift", "unbalance", "cogging", "torque_delay", "actuator_lag", "torque_saturation",
    "torque_deadzone", "torque_offset", "torque_scale", "flexible_mode", "sensor_lag", "rate_bias",
    "periodic_disturbance",
}  # fmt: skip
SUFFIX = {
    "N*m": "nm", "rad": "rad", "s": "s", "rad/s": "rad_s", "N*m/rad": "nm_rad", "N*m/rad^2": "nm_rad2",
    "N*m/rad^3": "nm_rad3", "N*m*s/rad": "nm_s_rad", "N*m*s^2/rad^2": "nm_s2_rad2", "N*m/(rad*s)": "nm_rad_s",
    "kg*m^2": "kg_m2", "Hz": "hz", "1": "", "1/rad": "",
}  # fmt: skip
SCALE = Scale(0.16, 7.0, 110.0, 10.0, 1e-3, 29.3, (0.5, 9.0), (50.0,))
ALL = pytest.mark.parametrize("name", effects.names())


def test_every_promised_name_is_there_and_has_a_test_value() -> None:
    assert set(effects.names()) == PROMISED == set(VALUES)


def test_every_file_beside_the_registry_is_an_effect_of_it() -> None:
    folder = Path(effects.__file__).parent
    files = {p.stem for p in folder.glob("*.py") if not p.stem.startswith("_")} - {"base"}
    assert files == set(effects._MODULES.values()) | set(effects._FORMS)


@pytest.mark.parametrize("name", [*effects._FURTHER, *effects._FORMS])
def test_a_model_may_hold_one_more_of_an_effect_or_another_form_of_it(name: str) -> None:
    assert name not in effects.known()
    values = {p.name: max(p.low, 0.1) for p in effects.get(name).parameters}
    assert check_effects({name: values}) == {name: values}
    assert effects.first_of(name) in effects.known()


@ALL
def test_an_effect_tells_its_equation_source_meaning_and_sign(name: str) -> None:
    effect = effects.get(name)
    assert effect.name == name
    assert all((effect.family, effect.equation, effect.source, effect.meaning, effect.sign))
    assert effect.separated_by or effect.name == "rate_bias"
    assert all(p.name in effect.equation for p in effect.parameters)


@ALL
def test_each_key_carries_the_unit_of_its_parameter(name: str) -> None:
    for p in effects.get(name).parameters:
        assert p.meaning
        assert p.suffix == SUFFIX[p.unit]
        assert p.key == (f"{p.name}_{p.suffix}" if p.suffix else p.name)
        assert p.low < p.high


@ALL
def test_a_search_for_a_shape_starts_within_its_bounds(name: str) -> None:
    for p in effects.get(name).parameters:
        if p.linear:
            continue
        assert p.start is not None, p.name
        starts = p.start(SCALE)
        assert starts
        assert all(p.low <= s <= p.high for s in starts)


@ALL
def test_effects_that_are_mentioned_exist_and_rivals_name_each_other(name: str) -> None:
    effect = effects.get(name)
    assert {*effect.lower_order, *effect.nests, *(effect.never_separable or {})} <= set(effects.names())
    for rival, alike in (effect.never_separable or {}).items():
        back = (effects.get(rival).never_separable or {})[name]
        assert back.travel_deg == alike.travel_deg


def test_gravity_passes_for_a_bent_spring_up_to_a_travel_and_a_lag_for_a_lag_at_any() -> None:
    gravity, lag = effects.get("unbalance"), effects.get("actuator_lag")
    for spring in ("cubic_stiffness", "quadratic_stiffness"):
        assert gravity.alike(spring, 10.0).startswith("within 15 deg")
        assert gravity.alike(spring, 57.0) == ""
    assert "second sensor" in lag.alike("sensor_lag", math.inf)
    assert gravity.alike("coulomb_friction", 0.1) == ""


def test_values_are_taken_by_name_or_by_key_and_never_guessed() -> None:
    stribeck = effects.get("stribeck_friction")
    assert stribeck.values({"coulomb_nm": 1, "static": 2, "speed_rad_s": 3}) == (1.0, 2.0, 3.0)
    with pytest.raises(KeyError, match="speed_rad_s"):
        stribeck.values({"coulomb_nm": 1, "static": 2})
    with pytest.raises(KeyError, match="viscous"):
        stribeck.values({"coulomb_nm": 1, "static": 2, "speed": 3, "viscous": 4})


@ALL
def test_at_rest_the_memory_of_an_effect_stands_still(name: str) -> None:
    effect = effects.get(name)
    if not effect.states:
        assert effect.rest_state is None
        return
    equations = Equations(Platform(effects={name: VALUES[name]}))
    torque = np.tile(677.3 * 0.05, (100, 3))
    held = equations.integrate(torque, 1e-3, (0.05, 0.0))
    np.testing.assert_allclose(held[:, :2], np.tile([0.05, 0.0], (101, 1)), atol=1e-12)


@ALL
def test_three_times_its_plausible_size_an_effect_still_leaves_a_finite_motion(name: str) -> None:
    time = np.arange(1001) * 1e-3
    torque = TorqueSignal(time, 80.0 * np.sin(2 * np.pi * 3 * time))
    effect = effects.get(name)
    large = {p.name: VALUES[name][p.name] * (3.0 if p.linear else 1.0) for p in effect.parameters}
    plain = simulate(Platform(), time, torque)
    for values in (VALUES[name], large):
        motion = simulate(Platform(effects={name: values}), time, torque)
        assert np.all(np.isfinite(motion.sensed_rate_rad_s))
        assert np.max(np.abs(motion.angle_rad)) < 1.0
        assert not np.array_equal(motion.sensed_rate_rad_s, plain.sensed_rate_rad_s), "an effect has to act"


@ALL
def test_a_finer_step_does_not_change_the_motion(name: str) -> None:
    time = np.arange(501) * 1e-3
    torque = TorqueSignal(time, 80.0 * np.sin(2 * np.pi * 3 * time))
    platform = Platform(effects={name: VALUES[name]})
    usual = Equations(platform).substeps(1e-3)
    rate = simulate(platform, time, torque, substeps=usual).sensed_rate_rad_s
    finer = simulate(platform, time, torque, substeps=4 * usual).sensed_rate_rad_s
    assert np.max(np.abs(rate - finer)) < math.radians(0.05) * 0.5, "half the noise of one gyro sample"


def test_every_place_between_torque_and_rate_is_taken() -> None:
    assert {effects.get(n).place for n in effects.names()} == set(Place)
