"""An effect written by a user is simulated, named and reported like any other."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "effects" / "your-own.md"
COMMAND = Path(sys.executable).parent / "identify-run"
CAMPAIGN = """
backend: simulated
model: {inertia_kg_m2: 0.018, damping_nm_s_rad: 0.06, stiffness_nm_rad: 640, effects_from: my_effect.py}
excitation:
  sets:
    - {kind: sine, torque_nm: 90, frequency_hz: 1, duration_s: 2}
    - {kind: sine, torque_nm: 40, frequency_hz: 9, duration_s: 2}
simulated:
  platform: {effects: {eddy_brake: {level_nm: 1.5, speed_rad_s: 1.2}}}
identify:
  genetic: {population: 20, generations: 10}
  candidates: [coulomb_friction, eddy_brake]
"""


def rebuilt(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """`rig report`, after the report was lost."""
    (folder / "report.html").unlink(missing_ok=True)
    rig = COMMAND.with_name("rig")
    return subprocess.run([str(rig), "report", str(folder), *options], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_an_effect_of_the_users_own_is_simulated_named_and_reported(tmp_path: Path) -> None:
    example = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    (tmp_path / "my_effect.py").write_text(example, encoding="utf-8")
    (tmp_path / "rig.yaml").write_text(CAMPAIGN, encoding="utf-8")
    out = tmp_path / "results"
    done = subprocess.run(
        [str(COMMAND), str(tmp_path / "rig.yaml"), "--out", str(out)], capture_output=True, text=True, check=False
    )
    assert done.returncode in (0, 1), done.stderr
    assert "eddy brake" in done.stdout
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"]["effects"] == ["eddy_brake"]
    found = {n: p["value"] for n, p in result["after"]["effect_parameters"]["eddy_brake"].items()}
    assert abs(found["level"] - 1.5) < 0.02
    assert abs(found["speed"] - 1.2) < 0.05
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "T = level * 2 x / (1 + x^2)" in report
    again = rebuilt(out)
    assert again.returncode == 2
    assert "--effects" in again.stderr
    again = rebuilt(out, "--effects", str(tmp_path / "my_effect.py"))
    assert again.returncode == 0, again.stderr
    assert "runs code" in again.stderr
    assert (out / "report.html").read_text(encoding="utf-8") == report
    assert f"effects_from:\n- {(tmp_path / 'my_effect.py').resolve()}" in (out / "model.yaml").read_text(
        encoding="utf-8"
    )
