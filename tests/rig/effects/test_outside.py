"""Effects from outside the package: a Python file named in rig.yaml, and an entry point of an installed package."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig import effects
from rig.config.load import load_config
from rig.config.model import model_yaml
from rig.dynamics import TorqueSignal, simulate
from rig.effects import _outside
from rig.errors import ConfigError
from rig.platform import Platform

PAGE = Path(__file__).parents[3] / "docs" / "effects" / "your-own.md"
EXAMPLE = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
RIG = "backend: simulated\nsimulated: {}\nmodel:\n  effects_from: my_effect.py\n"


@pytest.fixture(autouse=True)
def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """What one test reads, the next must not know."""
    monkeypatch.setattr(_outside, "_FILES", {})
    _outside._of_package.cache_clear()


def written(folder: Path, text: str = EXAMPLE, name: str = "my_effect.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def load(folder: Path, text: str = RIG) -> Any:
    path = folder / "rig.yaml"
    path.write_text(text, encoding="utf-8")
    return load_config(path)


def test_the_example_of_the_docs_is_under_thirty_lines() -> None:
    assert len(EXAMPLE.splitlines()) < 30


def test_the_example_of_the_docs_acts_by_its_equation(tmp_path: Path) -> None:
    effects.read_file(written(tmp_path))
    assert "eddy_brake" in effects.names()
    time = np.arange(2001) * 1e-3
    torque = TorqueSignal(time, 80.0 * np.sin(2 * np.pi * 3 * time))
    brake, slow = (
        Platform(effects={"eddy_brake": {"level": 2.0, "speed": 1e4}}),
        Platform(damping_nm_s_rad=0.045 + 4e-4),
    )
    rates = [simulate(p, time, torque).rate_rad_s for p in (brake, slow)]
    assert rates[0] == pytest.approx(rates[1], abs=1e-6)  # far below its speed it is 2 level / speed of damping


def test_a_file_named_in_the_yaml_is_known_wherever_an_effect_may_stand(tmp_path: Path) -> None:
    written(tmp_path)
    text = (
        "backend: simulated\nmodel: {effects_from: [my_effect.py]}\nidentify: {candidates: [eddy_brake]}\n"
        "simulated: {platform: {effects: {eddy_brake: {level_nm: 2, speed_rad_s: 3}}}}\n"
    )
    loaded = load(tmp_path, text)
    assert loaded.config.simulated.platform.platform().effects == {"eddy_brake": {"level": 2.0, "speed": 3.0}}
    assert EXAMPLE in loaded.included.values()
    load(tmp_path, text)  # a second time is no second effect of that name


def test_a_program_started_anew_reads_the_same_file_again(tmp_path: Path) -> None:
    """The compiled kernel is kept beside the file; the next start has to find the module that it belongs to."""
    code = f"from rig import effects; effects.read_file(__import__('pathlib').Path({str(written(tmp_path))!r}))"
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_the_twin_says_where_its_effect_is_written(tmp_path: Path) -> None:
    path = written(tmp_path)
    effects.read_file(path)
    model = model_yaml(Platform(effects={"eddy_brake": {"level": 2.0, "speed": 3.0}}))
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "model.yaml").write_text(model, encoding="utf-8")
    loaded = load(tmp_path, "backend: simulated\nsimulated: {}\nmodel: results/model.yaml\n")
    assert loaded.config.model.effects_from == (str(path.resolve()),)
    assert loaded.config.model.platform().effects["eddy_brake"]["speed"] == 3.0


def test_a_model_file_counts_its_effect_files_from_where_it_stands(tmp_path: Path) -> None:
    (tmp_path / "twin").mkdir()
    written(tmp_path / "twin")
    (tmp_path / "twin" / "model.yaml").write_text("effects_from: my_effect.py\n", encoding="utf-8")
    load(tmp_path, "backend: simulated\nsimulated: {}\nmodel: twin/model.yaml\n")
    assert "eddy_brake" in effects.names()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("EFFECT = Effect", "OTHER = Effect"), "defines no effect"),
        (('name="eddy_brake"', 'name="creep"'), "the name 'creep' is taken"),
        (('name="eddy_brake"', 'name="Eddy brake"'), "lower-case"),
        (("@kernel", "@(lambda f: f)"), "decorated with @kernel"),
        (("place=Place.LOAD", "place=Place.DRIVE"), "decorated with @filter_kernel"),
        (("start=speeds", "start=None"), "`start=`"),
        (("place=Place.LOAD", "formula='rate_rad_s ** 2', place=Place.LOAD"), r"write x \* x"),
        (("family=", "family"), r"my_effect.py:\d+: SyntaxError"),
        (("from rig.effects import", "raise ValueError('no')  #"), "my_effect.py:1: ValueError: no"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_line(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    assert change[0] in EXAMPLE
    written(tmp_path, EXAMPLE.replace(*change))
    with pytest.raises(ConfigError, match=r"rig.yaml:4: model.effects_from: .*my_effect.py.*") as caught:
        load(tmp_path)
    assert re.search(said, str(caught.value))
    assert "eddy_brake" not in effects.names()


def test_code_is_announced_each_time_before_it_is_run(tmp_path: Path) -> None:
    path = written(tmp_path, "raise ValueError('it ran')")
    (tmp_path / "rig.yaml").write_text(RIG, encoding="utf-8")
    for _ in range(2):
        said: list[str] = []
        with pytest.raises(ConfigError, match="it ran"):
            load_config(tmp_path / "rig.yaml", announce=said.append)
        assert said == [f"runs code: {path} (named by model.effects_from)"]


@pytest.mark.parametrize("section", ["model", "simulated.platform"])
@pytest.mark.parametrize("name", ["../evil.py", "{outside}/evil.py", "link.py", "below/../../evil.py"])
@pytest.mark.parametrize("way", ["file", "set"])
def test_code_outside_the_folder_of_the_yaml_is_refused_and_not_run(
    tmp_path: Path, name: str, section: str, way: str
) -> None:
    folder, ran = tmp_path / "campaign", tmp_path / "ran"
    (folder / "below").mkdir(parents=True)
    evil = written(tmp_path, f"open({str(ran)!r}, 'w').close()", "evil.py")
    try:
        (folder / "link.py").symlink_to(evil)
    except OSError:
        pytest.skip("links need rights of their own here")
    file, said = name.format(outside=tmp_path), []
    key = f"{section}.effects_from"
    text = "backend: simulated\nsimulated: {platform: {}}\nmodel: {}\n"
    if way == "file":
        old, new = ("model: {}", "model: {{{}}}") if section == "model" else ("platform: {}", "platform: {{{}}}")
        text = text.replace(old, new.format(f"effects_from: '{file}'"))
    (folder / "rig.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"{key}: .*its code is not run: review it, then copy it there"):
        load_config(folder / "rig.yaml", [f"{key}={file}"] if way == "set" else [], announce=said.append)
    assert not ran.exists() and said == []


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"model.effects_from: .*cannot be read"):
        load(tmp_path)


def test_two_files_must_not_bring_the_same_name(tmp_path: Path) -> None:
    written(tmp_path)
    written(tmp_path, name="again.py")
    with pytest.raises(ConfigError, match=r"again.py: the name 'eddy_brake' is taken"):
        load(tmp_path, RIG.replace("my_effect.py", "[my_effect.py, again.py]"))


def test_an_installed_package_brings_its_effect_without_a_line_in_the_yaml(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, name="brakes_of_ours.py")
    monkeypatch.syspath_prepend(str(tmp_path))
    point = EntryPoint("eddy_brake", "brakes_of_ours:EFFECT", _outside.GROUP)
    monkeypatch.setattr(_outside, "installed", lambda: {"eddy_brake": point})
    assert effects.names()[-1] == "eddy_brake"
    assert effects.get("eddy_brake").family == "friction"
    assert effects.file_of("eddy_brake") is None


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("creep", "brakes_of_ours:EFFECT", "name is taken"),
        ("wind", "brakes_of_ours:EFFECT", "its name is 'eddy_brake'"),
        ("wind", "no_such_package:EFFECT", "cannot be loaded: ModuleNotFoundError"),
        ("wind", "brakes_of_ours:drag", "not a rig.effects.Effect"),
    ],
)
def test_a_package_that_is_broken_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: str, said: str
) -> None:
    written(tmp_path, name="brakes_of_ours.py")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(_outside, "installed", lambda: {name: EntryPoint(name, value, _outside.GROUP)})
    with pytest.raises(ConfigError, match=said):
        assert name in effects.names()
        effects.get(name)
