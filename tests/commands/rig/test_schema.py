"""`rig schema` takes what the loader takes, refuses what it refuses, and describes every key."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from commands.campaign.device_settings import device_faults
from commands.rig.app import app
from commands.rig.schema import schema
from rig.config.load import load_config
from rig.config.parsing.yaml_text import parse
from rig.errors import ConfigError
from tests.commands.support import command
from tests.rig.config.test_malformed import CASES, RUNS

ROOT = Path(__file__).parents[3]
SHIPPED = ("rig.yaml", *sorted(f"examples/{path.name}" for path in (ROOT / "examples").glob("*.yaml")))
SIMULATED = "backend: simulated\nsimulated: {}\n"
BENCH = "backend: bench\nbench: "


@cache
def validator() -> Draft7Validator:
    Draft7Validator.check_schema(schema())
    return Draft7Validator(schema())


def faults(text: str) -> list[str]:
    """What the schema has against a file."""
    return [error.message for error in validator().iter_errors(parse(text, "rig.yaml").data)]


def is_refused_by_the_loader(folder: Path, text: str) -> bool:
    path = folder / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    try:
        load_config(path, also_wrong=device_faults)
    except ConfigError:
        return True
    return False


@pytest.mark.parametrize("name", SHIPPED)
def test_the_files_that_come_with_the_project_are_taken(name: str) -> None:
    assert faults((ROOT / name).read_text(encoding="utf-8")) == []


TAKEN = {
    "nothing but recordings": RUNS,
    "sections that are empty": f"{SIMULATED}model:\nlimits:\nexcitation:\nidentify:\n",
    "a backend's section that is empty": "backend: bench\nbench:\n",
    "a model from a file": f"{SIMULATED}model: model.yaml\nidentify: {{candidates: [of_that_file]}}\n",
    "a declared model that pushes away from rest": (
        f"{SIMULATED}model: {{damping_nm_s_rad: -0.1, stiffness_nm_rad: -1}}\n"
    ),
    "a truth without damping": "backend: simulated\nsimulated: {platform: {damping_nm_s_rad: 0}}\n",
    "an excitation from a file": f"{SIMULATED}excitation: follow_up.yaml\n",
    "a twin": "backend: simulated\nsimulated: {platform: model.yaml}\n",
    "parameters with and without their unit": (
        f"{SIMULATED}model: {{effects: {{coulomb_friction: {{level: 1}}, torque_delay: {{delay_s: 0}}}}}}\n"
    ),
    "further orders and other forms": (
        f"{SIMULATED}model: {{effects: {{cogging_2: {{sine: 0.6, cosine: 0.5, order: 37}}, "
        "sensor_lag_second_order: {time_s: 0.002}}}\n"
    ),
    "an effect of your own": (
        f"{SIMULATED}model: {{effects_from: mine.py, effects: {{wind: {{gain_nm_s2_rad2: 0.02}}}}}}\n"
        "identify: {candidates: [wind, backlash]}\n"
    ),
    "several files of effects": f"{SIMULATED}model: {{effects_from: [mine.py, more.py], effects: {{wind: {{}}}}}}\n",
    "the effect of a channel": (
        f"{RUNS}  columns: {{channels: {{heat: {{kind: temperature, column: T_C}}}}}}\n"
        "identify: {candidates: [heat_stiffness]}\n"
    ),
    "a set that does not say its kind": f"{SIMULATED}excitation: {{sets: [{{torque_nm: 1, frequency_hz: 2}}]}}\n",
    "other kinds of sets": (
        f"{SIMULATED}excitation:\n  sets:\n"
        "    - {kind: multisine, torque_nm: 80, from_hz: 0.5, to_hz: 40, duration_s: 20, travel_cap_deg: 8}\n"
        "    - {kind: ramp_hold_release, torque_nm: 60, ramp_s: 3, hold_s: 2, release_s: 3, duration_s: 20}\n"
        "    - {kind: free_decay, torque_nm: 60, pull_s: 2, hold_s: 1}\n"
    ),
    "a device that is not the default": f"{BENCH}{{gyroscope: {{device: kvh1750, settings: {{unit: deg}}}}}}\n",
    "a device without a driver, with another backend": (
        f"{SIMULATED}bench: {{gyroscope: {{device: to_come, settings: {{anything: 1}}}}}}\n"
    ),
    "a share held out": f"{SIMULATED}identify: {{holdout: 0.3}}\n",
}  # fmt: skip

# Names of effects and files that only the loader can look up; there the schema need not know better.
ELSEWHERE = ("model.yaml", "follow_up.yaml", "mine.py")


@pytest.mark.parametrize("case", TAKEN)
def test_what_the_loader_takes_is_taken(tmp_path: Path, case: str) -> None:
    text = TAKEN[case]
    assert faults(text) == []
    if not any(name in text for name in ELSEWHERE):
        assert not is_refused_by_the_loader(tmp_path, text)


REFUSED = {
    "an effect that is misspelt": f"{SIMULATED}model: {{effects: {{coulomb_frictoin: {{level_nm: 1}}}}}}",
    "the same in the truth": "backend: simulated\nsimulated: {platform: {effects: {backlsh: {half_gap_rad: 1}}}}",
    "a truth with a negative damping": "backend: simulated\nsimulated: {platform: {damping_nm_s_rad: -0.1}}",
    "a truth with a negative stiffness": "backend: simulated\nsimulated: {platform: {stiffness_nm_rad: -1}}",
    "a candidate that is misspelt": f"{SIMULATED}identify: {{candidates: [backlsh]}}",
    "a parameter twice": f"{SIMULATED}model: {{effects: {{torque_delay: {{delay_s: 0, delay_ms: 1}}}}}}",
    "a section that is null inside another": "backend: simulated\nsimulated: {gyro: null}",
    "a path for the wrong section": f"{SIMULATED}limits: limits.yaml",
    "recordings without files": f"{SIMULATED}recorded:\n",
    "a name that is null": f"{SIMULATED}name: null",
    "a kind that there is not": f"{SIMULATED}excitation: {{sets: [{{kind: squrae, torque_nm: 1}}]}}",
    "a key of another kind": f"{SIMULATED}excitation: {{sets: [{{torque_nm: 1, frequency_hz: 1, ramp_s: 2}}]}}",
    "a kind without what it needs": f"{SIMULATED}excitation: {{sets: [{{kind: chirp, torque_nm: 1}}]}}",
    "an amplifier of no kind": "backend: simulated\nsimulated: {amplifier: {kind: perfect}}",
    "a margin above one": f"{SIMULATED}excitation: {{margin: 1.2}}",
    "a rate below all": f"{SIMULATED}excitation: {{sample_rate_hz: 5}}",
    "a holdout of half the word": f"{SIMULATED}identify: {{holdout: automatic}}",
    "a channel of no kind": f"{RUNS}  columns: {{channels: {{heat: {{kind: warmth}}}}}}",
    "a channel with a capital": f"{RUNS}  columns: {{channels: {{Heat: {{kind: temperature}}}}}}",
    "a device that there is not": f"{BENCH}{{gyroscope: {{device: stim3000}}}}",
    "a setting of another device": f"{BENCH}{{gyroscope: {{device: kvh1750, settings: {{datagram: 0x90}}}}}}",
    "a setting out of its range": f"{BENCH}{{gyroscope: {{settings: {{filter_hz: 100}}}}}}",
    "a device without what it needs": f"{BENCH}{{amplifier: {{device: vesc}}}}",
    "a node beyond the bus": f"{BENCH}{{amplifier: {{node: 128}}}}",
    "a setting that is a list": f"{BENCH}{{gyroscope: {{settings: {{filter_hz: [16]}}}}}}",
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_loader_refuses_by_type_or_name_is_refused(tmp_path: Path, case: str) -> None:
    assert is_refused_by_the_loader(tmp_path, REFUSED[case])
    assert faults(REFUSED[case]) != []


# Malformed files of the loader's own tests that the schema lets pass: two keys have to be seen together, or a
# character has to be looked at; or an editor's own YAML parser refuses them before any schema does.
LEFT_TO_THE_LOADER = {
    "text turned around", "set turned around", "set faster than its ticks", "set of a single sample",
    "platform too fast to simulate", "window backwards", "nothing to fit", "column used twice", "duplicate key",
}  # fmt: skip


def parsed() -> Iterator[tuple[str, Any]]:
    """The loader's malformed files, as far as they are YAML that holds plain values."""
    for case, (text, *_) in CASES.items():
        try:
            document = parse(text, "rig.yaml")
        except ConfigError:
            continue
        if case == "duplicate key" or not document.faults:
            yield case, document.data


def test_of_the_loaders_malformed_files_those_pass_that_are_known_to() -> None:
    cases = dict(parsed())
    assert len(cases) > 40
    assert {case for case, data in cases.items() if validator().is_valid(data)} == LEFT_TO_THE_LOADER


def keys_of(part: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    """Every property anywhere in a schema, with its path."""
    if isinstance(part, dict):
        for key, value in part.items():
            if key == "properties":
                yield from ((f"{where}.{name}", one) for name, one in value.items())
            yield from keys_of(value, f"{where}.{key}")
    elif isinstance(part, list):
        for n, value in enumerate(part):
            yield from keys_of(value, f"{where}.{n}")


def test_every_key_is_described() -> None:
    described = schema()
    described.pop("allOf")  # conditions, which only repeat keys
    keys = dict(keys_of(described))
    assert len(keys) > 200
    silent = [path for path, one in keys.items() if not one.get("description") and set(one) != {"$ref"}]
    assert silent == []


UNITS = {
    "_nm": "N m", "_nm_rad": "N m/rad", "_hz": "Hz", "_ms": "ms", "_deg": "deg", "_deg_s": "deg/s", "_us": "us",
    "_rad_s": "rad/s", "_kg_m2": "kg m^2", "_nm_s_rad": "N m s/rad", "_nm_a": "N m/A", "_ppm": "ppm",
    "_percent": "percent",
}  # fmt: skip


def test_a_key_with_a_unit_says_it_in_its_description() -> None:
    described = schema()
    described["definitions"] = {n: d for n, d in described["definitions"].items() if not n.startswith("effect_")}
    of_unit = {
        path: (one["description"].lower(), max((s for s in UNITS if path.endswith(s)), key=len, default=""))
        for path, one in keys_of(described)
        if one.get("description")
    }
    checked = {path: (text, UNITS[suffix].lower()) for path, (text, suffix) in of_unit.items() if suffix}
    assert len(checked) > 60
    assert [path for path, (text, unit) in checked.items() if unit not in text] == []


def test_an_effect_is_described_with_its_equation_and_units() -> None:
    friction = schema()["definitions"]["effect_coulomb_friction"]
    assert "sgn" in friction["description"]
    assert friction["properties"]["level_nm"]["description"].endswith(", N*m")


def test_the_command_prints_the_schema() -> None:
    result = command(app, "schema")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == schema()
