"""From Python: the page's examples run, importing is light, and the numbers are those of `identify-run`."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import identify
import rig
from commands.identify_run.app import app
from tests.commands.support import command
from tests.identify.simulated import campaign

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "from-python.md"
CANDIDATES = ["coulomb_friction"]


def test_every_example_on_the_page_runs_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from matplotlib import pyplot  # noqa: PLC0415

    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    names: dict[str, Any] = {}
    examples = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    assert len(examples) >= 6
    for example in examples:
        exec(compile(example, str(PAGE), "exec"), names)
    pyplot.close("all")
    said = capsys.readouterr().out
    assert "['coulomb_friction']" in said
    assert "torque_nm has 1999 values and time_s has 2000: pass one value for every time" in said
    assert (tmp_path / "motion.png").stat().st_size > 10_000


@pytest.mark.parametrize("package", ["identify", "rig"])
def test_importing_a_package_imports_nothing_heavy(package: str) -> None:
    program = f"import sys, {package}; print([m for m in ('numpy', 'scipy', 'numba', 'h5py') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("package", [identify, rig], ids=lambda p: p.__name__)
def test_every_public_name_is_there_and_documented(package: Any) -> None:
    assert package.__all__ == sorted(package.__all__)
    for name in package.__all__:
        assert inspect.getdoc(getattr(package, name)), name
        assert name in dir(package)
    with pytest.raises(AttributeError, match="has no attribute 'identity'"):
        _ = package.identity


def test_a_name_of_a_module_inside_does_not_hide_the_function() -> None:
    program = "import identify.pipeline, identify.api.call\nfrom identify import identify\nprint(callable(identify))"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"


def test_the_same_data_through_both_doors_give_the_same_numbers(tmp_path: Path) -> None:
    recording = campaign({"coulomb_friction": {"level": 1.0}}, sets=((67.0, 6.0), (42.0, 9.0)), duration_s=1.0)
    entries = []
    for i, run in enumerate(recording.runs):
        assert run.torque_nm is not None and run.rate_rad_s is not None
        rows = zip(run.time_s.tolist(), run.torque_nm.tolist(), run.rate_rad_s.tolist(), strict=True)
        text = "time_s,torque_nm,rate_rad_s\n" + "".join(f"{t!r},{m!r},{w!r}\n" for t, m, w in rows)
        (tmp_path / f"run{i}.csv").write_text(text, encoding="utf-8")
        entries.append({"file": f"run{i}.csv"})
    config = {
        "backend": "recorded", "recorded": {"runs": entries}, "model": {"inertia_kg_m2": 0.018},
        "identify": {"candidates": CANDIDATES, "holdout": 0.2},
    }  # fmt: skip
    (tmp_path / "rig.yaml").write_text(json.dumps(config), encoding="utf-8")
    done = command(app, tmp_path / "rig.yaml", "--out", tmp_path / "out", "--quiet")
    assert done.exit_code == 0, done.stderr
    by_command = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    result = identify.identify(
        [run.time_s for run in recording.runs],
        [run.torque_nm for run in recording.runs],
        rate_rad_s=[run.rate_rad_s for run in recording.runs],
        declared={"inertia_kg_m2": 0.018}, holdout=0.2, settings={"candidates": CANDIDATES},
    )  # fmt: skip
    for one in by_command["per_set"]:  # runs are called by their files there
        one["name"] = one["genetic"]["name"] = f"run {1 + int(one['name'][3])}"
    assert json.loads(json.dumps(result.to_dict())) == by_command
    result.save(tmp_path / "saved")
    assert (tmp_path / "saved" / "model.yaml").read_bytes() == (tmp_path / "out" / "model.yaml").read_bytes()
