"""A model that reads a channel: written with what it counts from, read back the same."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rig import effects
from rig.channels import KINDS, NATURES, Channel
from rig.config.load import load_config
from rig.config.model import ModelConfig, model_yaml
from rig.effects import Place
from rig.errors import ConfigError
from rig.platform import Platform


def test_model_yaml_keeps_the_channel_its_reference_and_the_torque_of_an_ampere() -> None:
    effects.declare_channels([
        Channel("winding", "temperature", "", 21.25, 1.0), Channel("motor_current", "current", "", 0.0, 2.5)
    ])  # fmt: skip
    platform = Platform(
        0.0203, 0.0447, 677.3, {"winding_gain": {"slope": -0.002}, "motor_current_drive": {"share": 1.0}}
    )
    text = model_yaml(platform)
    assert yaml.safe_load(text)["channels"] == {
        "winding": {"kind": "temperature", "reference": 21.25},
        "motor_current": {"kind": "current", "reference": 0.0, "torque_constant_nm_a": 2.5},
    }
    assert yaml.safe_load(text)["effects"]["winding_gain"] == {"slope_1_per_k": -0.002}
    read = ModelConfig.model_validate(yaml.safe_load(text), strict=False).platform()
    assert read.effects == platform.effects
    assert read.channels["winding"] == Channel("winding", "temperature", "", 21.25, 1.0)
    assert read.channels["motor_current"].factor == 2.5


def test_a_model_whose_effect_reads_a_channel_that_it_does_not_declare_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("backend: simulated\nsimulated:\nmodel: {effects: {spindle_gain: {slope_1_per_k: 0.1}}}\n")
    with pytest.raises(ConfigError, match="unknown effect 'spindle_gain'"):
        load_config(path)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_makes_effects_that_say_what_they_are(kind: str) -> None:
    effects.declare_channels([Channel("probe", kind, reference=0.0, factor=1.0)])  # type: ignore[arg-type]
    names = effects.of_channel("probe")
    assert names == tuple(f"probe_{way}" for way in NATURES[kind].ways)
    for name in names:
        effect = effects.get(name)
        assert effect.place in (Place.LOAD, Place.FRICTION)
        assert "probe" in effect.meaning
        assert effect.equation
        assert effect.sign
        assert effect.separated_by
        assert len(effect.parameters) == 1
        assert effect.parameters[0].linear


def test_the_unit_of_a_slope_is_that_of_what_changes_over_that_of_the_channel() -> None:
    effects.declare_channels([Channel("belt", "acceleration", "m/s^2"), Channel("tank", "other")])
    belt, tank = effects.get("belt_torque").parameters[0], effects.get("tank_stiffness").parameters[0]
    assert (belt.unit, belt.key) == ("N*m/(m/s^2)", "slope_nm_per_m_s2")
    assert (tank.unit, tank.key) == ("N*m/rad", "slope_nm_rad")


def test_a_channel_declared_anew_takes_the_place_of_the_one_before() -> None:
    effects.declare_channels([Channel("probe", "temperature")])
    effects.declare_channels([Channel("probe", "acceleration")])
    assert effects.of_channel("probe") == ("probe_torque",)
    assert "probe_gain" not in effects.known()
    assert "probe_torque" not in effects.names()
