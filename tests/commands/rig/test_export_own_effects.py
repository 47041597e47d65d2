"""`rig export` of a run whose model has an effect of the user's own, and the words its help uses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from commands.rig.app import app
from identify.report.files import write_results
from rig import effects
from rig.config.load import load_config
from rig.effects import _outside
from rig.platform import Platform
from rig.recording.load import read_recording
from tests.commands.support import command
from tests.identify.sample import TRUTH, sample
from tests.rig.effects.test_outside import EXAMPLE


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A results folder whose model has an eddy brake; in this process nothing of it is known."""
    monkeypatch.setattr(_outside, "_FILES", {})
    file = tmp_path / "my_effect.py"
    file.write_text(EXAMPLE, encoding="utf-8")
    effects.read_file(file)
    found, recording = sample(1.0)
    model = replace(TRUTH, effects={"coulomb_friction": {"level": 1.2}, "eddy_brake": {"level": 1.0, "speed": 1.0}})
    found = replace(
        found, after=replace(found.final, platform=model), verdict=replace(found.verdict, effects=("eddy_brake",))
    )
    (tmp_path / "run").mkdir()
    write_results(tmp_path / "run", found, recording, Platform(0.0185, 0.06, 650.0), "default")
    monkeypatch.setattr(_outside, "_FILES", {})
    return tmp_path / "run"


def test_a_compensation_with_an_effect_of_your_own_asks_for_its_file(own: Path) -> None:
    done = command(app, "export", own, "--to", "compensation")
    assert done.exit_code == 2, done.output
    assert (
        "effects of your own (eddy_brake)" in done.stderr and f"--effects {own.parent / 'my_effect.py'}" in done.stderr
    )
    assert not (own / "export_compensation").exists()
    done = command(app, "export", own, "--to", "compensation", "--effects", own.parent / "my_effect.py")
    assert done.exit_code == 0, done.output
    assert "runs code" in done.stderr and (own / "export_compensation" / "compensation.c").is_file()


def test_a_model_with_an_effect_of_your_own_asks_for_its_file_and_has_its_equation(own: Path) -> None:
    done = command(app, "export", own, "--to", "model-json")
    assert done.exit_code == 2 and f"--effects {own.parent / 'my_effect.py'}" in done.stderr
    assert not (own / "export_model-json").exists()
    done = command(app, "export", own, "--to", "model-json", "--effects", own.parent / "my_effect.py")
    assert done.exit_code == 0 and "runs code" in done.stderr, done.output
    read = json.loads((own / "export_model-json" / "platform.json").read_text(encoding="utf-8"))
    brake = next(one for one in read["effects"] if one["name"] == "eddy_brake")
    assert brake["equation"] == effects.get("eddy_brake").equation
    assert brake["formula"] is None
    done = command(app, "export", own, "--to", "modelica", "--effects", own.parent / "my_effect.py")
    assert done.exit_code == 0, done.output
    text = (own / "export_modelica" / "Platform.mo").read_text(encoding="utf-8")
    assert "eddy brake, because its file gives no formula" in text


@pytest.mark.parametrize(
    ("word", "file"), [("model-json", "platform.json"), ("model-mat", "platform.mat"), ("modelica", "Platform.mo")]
)
def test_the_model_is_written_in_every_format_and_never_over_another(tmp_path: Path, word: str, file: str) -> None:
    found, recording = sample(1.0)
    (tmp_path / "run").mkdir()
    found = replace(found, after=replace(found.final, platform=TRUTH), accepted=False, reasons=("too little moved",))
    write_results(tmp_path / "run", found, recording, Platform(0.0185, 0.06, 650.0), "default")
    done = command(app, "export", tmp_path / "run", "--to", word)
    assert done.exit_code == 0, done.output
    target = tmp_path / "run" / f"export_{word}" / file
    assert f"{target}: written" in done.stdout and target.stat().st_size > 500
    assert f"NOT ACCEPTED: read {tmp_path / 'run' / 'report.html'}" in done.stdout
    again = command(app, "export", tmp_path / "run", "--to", word)
    assert again.exit_code == 2 and "never overwritten" in again.stderr
    absent = command(app, "export", tmp_path, "--to", word)
    assert absent.exit_code == 2 and "give the results folder of an identify-run" in absent.stderr


@pytest.mark.parametrize(("declared", "stiffness"), [(True, 660.0), (False, 33000.0)])
def test_a_decay_is_exported_with_the_inertia_that_was_declared(
    tmp_path: Path, declared: bool, stiffness: float
) -> None:
    found, recording = sample(1.0)
    ratios = replace(found.final, platform=Platform(1.0, 2.2, 33000.0))
    (tmp_path / "run").mkdir()
    write_results(
        tmp_path / "run", replace(found, after=ratios, torque_free=True), recording, Platform(0.02), "decay",
        inertia_declared=declared,
    )  # fmt: skip
    assert command(app, "export", tmp_path / "run", "--to", "model-json", "--out", tmp_path / "out").exit_code == 0
    read = json.loads((tmp_path / "out" / "platform.json").read_text(encoding="utf-8"))
    assert read["per_inertia"] is not declared
    assert read["parameters"]["stiffness"]["value"] == pytest.approx(stiffness)


def test_an_exported_configuration_names_the_file_of_an_effect_of_your_own(own: Path, tmp_path: Path) -> None:
    done = command(app, "export", own, "--to", "csv", "--out", tmp_path / "without")
    assert done.exit_code == 0 and "does not name your own effects (eddy_brake)" in done.stdout
    assert f"--effects {tmp_path / 'my_effect.py'}" in done.stdout
    done = command(app, "export", own, "--to", "csv", "--out", tmp_path / "out", "--effects", tmp_path / "my_effect.py")
    assert done.exit_code == 0 and "does not name" not in done.stdout, done.output
    written = yaml.safe_load((tmp_path / "out" / "rig.yaml").read_text(encoding="utf-8"))
    assert written["model"] == {"effects_from": ["my_effect.py"]}
    assert read_recording(load_config(tmp_path / "out" / "rig.yaml")).runs
    assert effects.exists("eddy_brake")


def test_a_file_of_effects_that_cannot_be_taken_along_is_said(own: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none", encoding="utf-8")
    for file, said in (("absent.py", "no such file"), ("notes.txt", "ends in .py")):
        done = command(app, "export", own, "--to", "csv", "--effects", tmp_path / file)
        assert done.exit_code == 2 and said in done.stderr, done.output
        assert not (own / "export_csv").exists()


@pytest.mark.parametrize("word", ["C", "python", "Table"])
def test_the_words_of_the_help_write_the_compensation(tmp_path: Path, word: str) -> None:
    found, recording = sample(1.0)
    (tmp_path / "run").mkdir()
    write_results(tmp_path / "run", found, recording, Platform(0.0185, 0.06, 650.0), "default")
    done = command(app, "export", tmp_path / "run", "--to", word)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "run" / "export_compensation" / "compensation.py").is_file()
