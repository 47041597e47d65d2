"""Whole simulated campaigns: played by the sequencer on the simulated rig, read by the identifier alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
TERMS = ("inertia", "damping", "stiffness")
PUBLISHED = {
    "table1": {"inertia": 0.95, "damping": 0.91, "stiffness": 0.33},
    "table2": {"inertia": 2.97, "damping": 2.86, "stiffness": 1.65},
}
SEEDS = range(1, 6)


def run(folder: Path, config: str, *more: str) -> tuple[dict[str, Any], str]:
    """result.json and the summary of one campaign that has to be accepted."""
    command = [sys.executable, "-c", "from commands.identify_run import main; main()", str(ROOT / config)]
    done = subprocess.run(
        [*command, "--out", str(folder / "out"), *more],
        cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "out" / "result.json").read_text(encoding="utf-8")), done.stdout


def values(model: dict[str, Any]) -> dict[str, float]:
    return {t: model["parameters"][t]["value"] for t in TERMS}


SHORT = "[{torque_nm: 300, frequency_hz: 1, duration_s: 2}, {torque_nm: 200, frequency_hz: 6, duration_s: 2}]"


@pytest.mark.parametrize(
    ("offered", "more"),
    [
        ("[coulomb_friction, torque_delay]", ("--set", f"excitation.sets={SHORT}", "--set", "excitation.rest_s=6")),
        pytest.param("[coulomb_friction, torque_delay]", (), marks=pytest.mark.slow),
        pytest.param(
            "[coulomb_friction, torque_delay, presliding_friction, sensor_lag, unbalance]", (), marks=pytest.mark.slow
        ),
        pytest.param("null", (), marks=pytest.mark.slow),  # the whole library, as the file has it
    ],
)
def test_the_default_campaign_names_both_hidden_effects_and_mends_every_parameter(
    tmp_path: Path, offered: str, more: tuple[str, ...]
) -> None:
    found, said = run(tmp_path, "rig.yaml", "--set", f"identify.candidates={offered}", *more)
    assert set(found["verdict"]["effects"]) == {"coulomb_friction", "torque_delay"}
    truth = {"inertia": 0.0203, "damping": 0.0447, "stiffness": 681.2}
    before, after = values(found["before"]), values(found["after"])
    assert abs(before["damping"] / truth["damping"] - 1) > 1.0
    assert after["damping"] == pytest.approx(truth["damping"], rel=0.03)
    assert after["inertia"] == pytest.approx(truth["inertia"], rel=0.01)
    assert after["stiffness"] == pytest.approx(truth["stiffness"], rel=0.01)
    assert found["after"]["error"]["holdout_rate_rms"] < 1.1 * found["noise_floor"]["holdout_rate_rms"]
    assert "Coulomb friction" in said
    assert "delay" in said


@pytest.mark.slow
def test_the_twin_made_of_the_result_moves_as_the_rig_did(tmp_path: Path) -> None:
    run(tmp_path, "rig.yaml", "--set", "identify.candidates=[coulomb_friction, torque_delay]")
    again = tmp_path / "again"
    again.mkdir()
    twin = f"simulated.platform={tmp_path / 'out' / 'model.yaml'}"
    found, _ = run(again, "rig.yaml", "--set", twin, "--set", "identify.candidates=[coulomb_friction, torque_delay]")
    level = found["after"]["effect_parameters"]["coulomb_friction"]["level"]["value"]
    assert level == pytest.approx(1.2, rel=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("table", PUBLISHED)
def test_every_set_is_within_the_published_largest_error(tmp_path: Path, table: str, seed: int) -> None:
    found, _ = run(tmp_path, f"examples/{table}.yaml", "--seed", str(seed))
    assert len(found["per_set"]) == 5
    for term, published in PUBLISHED[table].items():
        assert found["max_error_percent"][term] <= published
        assert all(term in one["parameters"] for one in found["per_set"])


@pytest.mark.slow
def test_the_undeclared_friction_of_table_two_ruins_damping_until_the_loop_finds_it(tmp_path: Path) -> None:
    found, _ = run(tmp_path, "examples/table2.yaml")
    assert found["verdict"]["effects"] == ["stribeck_friction"]
    assert values(found["before"])["damping"] > 2 * 0.0454
    assert values(found["after"])["damping"] == pytest.approx(0.0454, rel=0.0286)
    friction = found["after"]["effect_parameters"]["stribeck_friction"]
    assert friction["coulomb"]["value"] == pytest.approx(3.2, rel=0.01)
    assert friction["static"]["value"] == pytest.approx(5.0, rel=0.02)
    assert friction["speed"]["value"] == pytest.approx(0.08, rel=0.05)


@pytest.mark.slow
def test_declared_models_ten_times_off_end_at_the_same_numbers(tmp_path: Path) -> None:
    ends = []
    for k, factor in enumerate((0.1, 10.0)):
        folder = tmp_path / str(k)
        folder.mkdir()
        model = (
            f"{{inertia_kg_m2: {0.016 * factor}, damping_nm_s_rad: {0.08 * factor}, stiffness_nm_rad: {600 * factor}}}"
        )
        (folder / "model.yaml").write_text(model, encoding="utf-8")
        # Declared ten times too soft, the forecast of travel is ten times too large: the limits are lifted for it, and
        # the check of the motion is off, which takes inertia and stiffness for right to within a factor of two.
        found, _ = run(
            folder, "examples/table1.yaml", "--set", f"model={folder / 'model.yaml'}",
            "--set", "limits.travel_deg=1000", "--set", "limits.rate_deg_s=1e6",
            "--set", "limits.motion_check=false",
        )  # fmt: skip
        ends.append(values(found["before"]))
    for term in TERMS:
        assert ends[0][term] == pytest.approx(ends[1][term], rel=1e-6)
