"""A good rig.yaml becomes a Config; names, overrides and included models do what SPEC says."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rig.config.load import LoadedConfig, config_as_recorded, load_config
from rig.config.model import ModelConfig, model_yaml
from rig.errors import ConfigError
from rig.platform import Platform

SMALLEST = "backend: recorded\nrecorded:\n  runs:\n    - file: run1.csv\n"


def load(folder: Path, text: str, *overrides: str) -> LoadedConfig:
    path = folder / "my bench.yaml"
    path.write_text(text, encoding="utf-8")
    return load_config(path, overrides)


def test_a_recorded_campaign_needs_no_more_than_its_files(tmp_path: Path) -> None:
    loaded = load(tmp_path, SMALLEST)
    assert loaded.config.recorded is not None
    assert [run.file for run in loaded.config.recorded.runs] == ["run1.csv"]
    assert loaded.config.recorded.axis == "rotary"
    assert loaded.folder == tmp_path


def test_the_name_is_the_stem_of_the_file_unless_given(tmp_path: Path) -> None:
    assert load(tmp_path, SMALLEST).config.name == "my bench"
    assert load(tmp_path, SMALLEST + "name: arm 2\n").config.name == "arm 2"


def test_defaults_are_the_papers(tmp_path: Path) -> None:
    config = load(tmp_path, SMALLEST).config
    genetic = config.identify.genetic
    assert (genetic.population, genetic.generations) == (100, 200)
    assert (genetic.crossover_probability, genetic.mutation_probability) == (0.7, 0.1)
    platform = config.model.platform()
    assert (platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad) == (0.02, 0.045, 677.3)
    assert config.identify.follow_up == "ask"


def test_the_text_is_kept_as_read(tmp_path: Path) -> None:
    text = "# über alles\n" + SMALLEST
    assert load(tmp_path, text, "identify.seed=7").text == text


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    assert load(tmp_path, "\ufeff" + SMALLEST).config.backend == "recorded"


@pytest.mark.parametrize(("written", "value"), [("1e-3", 1e-3), ("1.5e3", 1500.0), ("010", 10.0), ("0x10", 16.0)])
def test_numbers_are_what_they_look_like(tmp_path: Path, written: str, value: float) -> None:
    assert load(tmp_path, SMALLEST + f"identify: {{lowpass_hz: {written}}}").config.identify.lowpass_hz == value


def test_words_of_old_yaml_are_plain_text(tmp_path: Path) -> None:
    text = "backend: recorded\nrecorded: {columns: {time: on, rate: y, angle: 1:30}, runs: [{file: no}]}\n"
    section = load(tmp_path, text).config.recorded
    assert section is not None
    assert (section.columns.time, section.columns.rate, section.columns.angle) == ("on", "y", "1:30")
    assert section.runs[0].file == "no"


def test_an_empty_section_means_its_defaults(tmp_path: Path) -> None:
    assert load(tmp_path, SMALLEST + "identify:\n").config.identify.seed == 1


def test_an_alias_may_be_used(tmp_path: Path) -> None:
    text = "backend: recorded\nrecorded:\n  runs: [{file: &f a.csv, to_s: 1}, {file: *f, from_s: 2}]\n"
    section = load(tmp_path, text).config.recorded
    assert section is not None and section.runs[1].file == "a.csv"


# --- overrides


def test_set_replaces_one_key_and_makes_missing_sections(tmp_path: Path) -> None:
    loaded = load(tmp_path, SMALLEST, "identify.genetic.population=500", "recorded.runs.0.use=fit")
    assert loaded.config.identify.genetic.population == 500
    assert loaded.config.recorded is not None and loaded.config.recorded.runs[0].use == "fit"
    assert loaded.overrides == ("identify.genetic.population=500", "recorded.runs.0.use=fit")


def test_set_takes_yaml_values(tmp_path: Path) -> None:
    loaded = load(tmp_path, SMALLEST, "model.terms=[inertia, damping]", "identify.candidates=null")
    assert loaded.config.model.terms == ("inertia", "damping")
    assert loaded.config.identify.candidates is None


def test_set_mends_what_is_wrong_in_the_file(tmp_path: Path) -> None:
    text = SMALLEST + "identify: {j_dec: .nan, seed: many}\n"
    config = load(tmp_path, text, "identify.j_dec=0.5", "identify.seed=3").config
    assert (config.identify.j_dec, config.identify.seed) == (0.5, 3)


@pytest.mark.parametrize(
    ("override", "cause", "cure"),
    [
        ("identify.seed", "has to be KEY=VALUE", "--set identify.genetic.population=500"),
        ("=3", "has to be KEY=VALUE", "e.g."),
        ("identify.genetic.populaton=5", "unknown key 'populaton'", "did you mean 'population'"),
        ("identify.seed=many", "'many' is not allowed", "whole number"),
        ("recorded.runs.3.use=fit", "a list of 1", "from 0 to 0"),
        ("recorded.runs.first.use=fit", "a list of 1", "from 0 to 0"),
        ("backend.kind=1", "backend is the value 'recorded'", "no key 'kind'"),
        ("excitation.sets.0.torque_nm=1", "no item 0", "give the whole list"),
        ("identify.seed=[1", "not YAML", "brackets"),
        ("identify.j_dec=.inf", ".inf is not allowed", "finite number"),
    ],
)
def test_a_wrong_set_is_named_by_its_text(tmp_path: Path, override: str, cause: str, cure: str) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, SMALLEST, override)
    assert f"--set {override}" in str(error.value)
    assert cause in str(error.value)
    assert cure in str(error.value)


# --- models


TWIN = Platform(0.021, 0.05, 650.0, {"coulomb_friction": {"level": 1.25}, "torque_delay": {"delay": 0.0015}})


@pytest.mark.parametrize("head", ["", "model:\n"])
def test_a_model_file_may_stand_for_the_section(tmp_path: Path, head: str) -> None:
    body = model_yaml(TWIN, "from a campaign")
    indented = body if not head else "".join(f"  {line}\n" for line in body.splitlines())
    (tmp_path / "twin.yaml").write_text(head + indented)
    loaded = load(tmp_path, SMALLEST + "model: twin.yaml\nsimulated: {platform: twin.yaml}\n")
    assert loaded.config.model.platform() == TWIN
    assert loaded.config.simulated.platform.platform() == TWIN
    assert list(loaded.included) == [str(tmp_path / "twin.yaml")]


def test_a_model_survives_being_written_and_pasted(tmp_path: Path) -> None:
    text = model_yaml(TWIN)
    assert "level_nm: 1.25" in text and "delay_s: 0.0015" in text
    assert ModelConfig(**yaml.safe_load(text)).platform() == TWIN


def test_an_included_model_can_be_overridden(tmp_path: Path) -> None:
    (tmp_path / "twin.yaml").write_text(model_yaml(TWIN))
    config = load(tmp_path, SMALLEST + "model: twin.yaml\n", "model.inertia_kg_m2=0.5").config
    assert (config.model.inertia_kg_m2, config.model.stiffness_nm_rad) == (0.5, 650.0)


def test_a_model_known_per_unit_of_inertia_makes_a_twin_and_moves_no_bench(tmp_path: Path) -> None:
    (tmp_path / "twin.yaml").write_text(model_yaml(TWIN, inertia_unknown=True))
    models = "model: twin.yaml\nsimulated: {platform: twin.yaml}\n"
    model = load(tmp_path, "backend: simulated\n" + models).config.model
    assert model.platform() == TWIN
    assert not model.inertia_declared
    with pytest.raises(ConfigError, match=r"model: .*the values of this model are per unit of inertia"):
        load(tmp_path, "backend: bench\n" + models, "model.inertia_kg_m2=0.5")


def test_an_inertia_is_declared_where_somebody_gave_it(tmp_path: Path) -> None:
    assert not load(tmp_path, SMALLEST).config.model.inertia_declared
    assert not load(tmp_path, SMALLEST + "model: {stiffness_nm_rad: 3}\n").config.model.inertia_declared
    assert load(tmp_path, SMALLEST + "model: {inertia_kg_m2: 0.02}\n").config.model.inertia_declared


def test_a_fault_in_an_included_model_names_that_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "twin.yaml").write_text("inertia_kg_m2: 0.02\nstifness_nm_rad: 3\n")
    with pytest.raises(ConfigError, match=r"twin\.yaml:2: model\.stifness_nm_rad: .*did you mean 'stiffness_nm_rad'"):
        load(tmp_path, SMALLEST + "model: twin.yaml\n")


def test_a_missing_model_file_is_said_with_the_line_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"my bench\.yaml:5: model: .*gone\.yaml: no such file: check the name"):
        load(tmp_path, SMALLEST + "model: gone.yaml\n")


@pytest.mark.parametrize("head", ["", "excitation:\n"])
def test_an_excitation_file_may_stand_for_the_section(tmp_path: Path, head: str) -> None:
    body = "sample_rate_hz: 500.0\nsets:\n- {torque_nm: 3.0, frequency_hz: 2.0}\n"
    indented = body if not head else "".join(f"  {line}\n" for line in body.splitlines())
    (tmp_path / "follow_up.yaml").write_text(f"# why\n{head}{indented}")
    loaded = load(tmp_path, SMALLEST, "excitation=follow_up.yaml", "excitation.rest_s=3")
    assert (loaded.config.excitation.sample_rate_hz, loaded.config.excitation.rest_s) == (500.0, 3.0)
    assert [s.title for s in loaded.config.excitation.sets] == ["2 Hz"]
    assert list(loaded.included) == [str(tmp_path / "follow_up.yaml")]


def test_a_missing_excitation_file_is_said_to_be_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"excitation: names an excitation file: .*gone\.yaml: no such file"):
        load(tmp_path, SMALLEST + "excitation: gone.yaml\n")


def test_a_term_left_out_is_zero_in_the_platform(tmp_path: Path) -> None:
    platform = load(tmp_path, SMALLEST + "model: {terms: [inertia, damping]}\n").config.model.platform()
    assert platform.stiffness_nm_rad == 0.0
    assert platform.terms == ("inertia", "damping")


def test_the_example_for_a_recording_of_ones_own_is_a_good_config() -> None:
    loaded = load_config(Path(__file__).parents[3] / "examples" / "recorded.yaml")
    assert loaded.config.recorded is not None
    assert loaded.config.recorded.runs[0].file == "my_recording.csv"


def test_a_configuration_that_a_recording_quotes_is_read_without_the_disk(tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text("model: {damping_nm_s_rad: 0.3}\n", encoding="utf-8")
    loaded = load(tmp_path, "model: arm.yaml\n" + SMALLEST, "identify.seed=7")
    (tmp_path / "arm.yaml").unlink()
    quoted = config_as_recorded(loaded.text, loaded.path, loaded.overrides, loaded.included)
    assert quoted == loaded.config
    assert quoted.model.declared_numbers == {"damping": 0.3}
    newer = config_as_recorded(loaded.text, loaded.path, loaded.overrides, loaded.included, ["identify.seed=8"])
    assert newer.identify.seed == 8


def test_a_recording_from_another_system_finds_the_model_that_it_quotes() -> None:
    text, included = "model: arm.yaml\n" + SMALLEST, {"D:\\rigs\\arm.yaml": "model: {damping_nm_s_rad: 0.3}\n"}
    config = config_as_recorded(text, Path("D:\\rigs\\bench.yaml"), (), included)
    assert (config.model.damping_nm_s_rad, config.name) == (0.3, "bench")
    with pytest.raises(ConfigError, match="its text is not in the recording"):
        config_as_recorded(text, Path("rig.yaml"), (), {})


def test_code_that_a_quoted_configuration_names_is_not_run(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("raise SystemExit\n", encoding="utf-8")
    for section in ("model", "simulated: {platform"):
        closed = "}" * section.count("{")
        text = f"{section}: {{effects_from: {tmp_path / 'own.py'}}}{closed}\n" + SMALLEST
        with pytest.raises(ConfigError, match="code that a recording names is not run"):
            config_as_recorded(text, tmp_path / "rig.yaml", (), {})
