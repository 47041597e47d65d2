"""The identifier cannot see who made a recording: neither by import nor by what is handed over."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from rig.recording.run import Recording, Run

ROOT = Path(__file__).parents[2]
MODULES = sorted((ROOT / "identify").rglob("*.py"))
MAKERS = {"drivers", "sim_backend"}


def imported(path: Path) -> set[str]:
    """Every module that a file imports, wherever in the file."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_module_of_the_identifier_imports_a_maker_of_recordings_or_the_commands(path: Path) -> None:
    names = imported(path)
    assert {*MAKERS, "commands"}.isdisjoint(name.split(".")[0] for name in names)
    assert not any(name.startswith("rig.config.simulated") for name in names)


def test_no_module_of_the_identifier_brings_a_maker_in_by_a_detour() -> None:
    modules = [".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for p in MODULES]
    program = (
        f"import importlib, sys\nfor name in {modules!r}: importlib.import_module(name)\n"
        f"print([name for name in sys.modules if name.split('.')[0] in {sorted(MAKERS)!r}])"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_recording_has_room_for_samples_and_not_for_a_platform() -> None:
    assert {f.name for f in fields(Recording)} == {"runs", "axis", "noise", "info"}
    assert {f.name for f in fields(Run)} == {
        "name", "time_s", "valid", "rate_rad_s", "angle_rad", "torque_time_s", "torque_nm", "torque_hold", "use",
        "min_rate_rad_s", "added_inertia_kg_m2", "frequency_hz", "channels", "causes", "rate_corner_hz", "rate_delay_s",
        "excerpt", "wraps", "missing", "notes",
    }  # fmt: skip


CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]


def test_no_import_contract_has_an_exception() -> None:
    assert [c["name"] for c in CONTRACTS if "ignore_imports" in c] == []


def test_every_contract_of_layers_has_a_place_for_each_module() -> None:
    layered = [c for c in CONTRACTS if c["type"] == "layers"]
    assert [c["name"] for c in layered if "containers" in c and not c.get("exhaustive")] == []
    (top,) = (c for c in layered if "containers" not in c)
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"tests"}
    assert {name.strip() for layer in top["layers"] for name in layer.split("|")} == packages


def test_everything_of_the_drivers_but_the_codecs_is_closed_to_the_simulator() -> None:
    (contract,) = (c for c in CONTRACTS if c.get("source_modules") == ["sim_backend"])
    parts = {p.stem for p in (ROOT / "drivers").iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()}
    assert set(contract["forbidden_modules"]) == {f"drivers.{part}" for part in parts - {"__init__", "codecs"}}
