"""What a worker makes of one campaign."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import h5py
import pytest

from commands.identify_batch.campaign import ProcessEnded, identified_here, identify_campaign
from commands.identify_batch.campaigns import Job
from commands.identify_batch.row import COLUMNS, FAILED, IDENTIFIED
from commands.identify_run.app import app
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from tests.commands.identify_batch.campaigns import PLAYED, play, recorded
from tests.commands.support import command

PAGE = Path(__file__).parents[3] / "docs" / "effects" / "your-own.md"
OWN_EFFECT = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]


def job(file: Path, *overrides: str, results: Path | None = None) -> Job:
    return Job(file.as_posix(), str(file), overrides, "content", None if results is None else str(results))


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play(tmp_path_factory.mktemp("played") / "monday", 1)


@pytest.fixture
def copy(played: Path, tmp_path: Path) -> Path:
    """A recording to spoil."""
    path = tmp_path / "copied" / "recording.h5"
    path.parent.mkdir()
    path.write_bytes(played.read_bytes())
    return path


def with_info(path: Path, **changed: object) -> Path:
    """The recording with other words about its origin."""
    recording = read_recording_h5(path)
    path.unlink()
    write_recording_h5(path, dataclasses.replace(recording, info={**recording.info, **changed}))
    return path


def test_a_row_has_the_numbers_of_identify_run_on_the_same_recording(tmp_path: Path) -> None:
    config = tmp_path / "rig.yaml"
    config.write_text(PLAYED, encoding="utf-8")
    assert command(app, config, "--out", tmp_path / "run", "--quiet").exit_code in (0, 1)
    played = tmp_path / "run" / "recording.h5"
    row = identified_here(job(played, results=tmp_path / "kept"))
    expected = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))
    assert list(row) == list(COLUMNS)
    assert (row["status"], row["name"], row["rig"]) == (IDENTIFIED, "run", "bench-a")
    assert row["recorded_utc"] == read_recording_h5(played).info["started_utc"]
    assert row["effects"] == expected["verdict"]["effects"] == ["coulomb_friction"]
    assert json.loads(row["effect_parameters_json"]) == expected["after"]["effect_parameters"]
    for name, found in expected["after"]["parameters"].items():
        assert [row[f"{name}_value"], row[f"{name}_std_error"]] == [found["value"], found["std_error"]]
        assert [row[f"{name}_ci95_low"], row[f"{name}_ci95_high"]] == found["ci95"]
    assert row["holdout_rate_rms_before"] == expected["before"]["error"]["holdout_rate_rms"]
    assert row["holdout_rate_rms_after"] == expected["after"]["error"]["holdout_rate_rms"]
    assert row["disturbance_torque_rms"] == expected["disturbance"]["torque_rms"]
    kept = json.loads((tmp_path / "kept" / "result.json").read_text(encoding="utf-8"))
    assert kept["after"]["parameters"] == expected["after"]["parameters"]
    assert row["results"] == str(tmp_path / "kept")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["kept", "rig.yaml", "run"]


@pytest.mark.slow
def test_settings_of_today_come_on_top_of_those_of_the_recording(played: Path) -> None:
    row = identified_here(job(played, "identify.candidates=[]"))
    assert row["status"] == IDENTIFIED
    assert row["effects"] == []
    other = identified_here(job(played, "identify.candidates=[]", "identify.seed=2"))
    assert row["config_sha256"] != other["config_sha256"]


def test_a_campaign_cut_short_is_identified_from_its_complete_sets_and_says_so(copy: Path) -> None:
    sets = [dict(one, complete=i == 0) for i, one in enumerate(read_recording_h5(copy).info["sets"])]
    cut_short = with_info(copy, aborted="Stopped by Ctrl-C.", sets=sets)
    declared = "model.effects={coulomb_friction: {level_nm: 0.4}}"
    row = identified_here(job(cut_short, "identify.candidates=[]", declared))
    assert (row["status"], row["aborted"]) == (IDENTIFIED, True)
    assert row["reason"].startswith("the campaign was cut short, this is from its complete sets: Stopped by Ctrl-C.")


@pytest.mark.parametrize(
    ("override", "words"),
    [("identify.candidates=[no_such]", "no_such"), ("identify.seed=x", "identify.seed"), ("nonsense", "KEY=VALUE")],
)
def test_a_wrong_setting_is_a_failed_row_that_names_it(played: Path, override: str, words: str) -> None:
    row = identified_here(job(played, override))
    assert row["status"] == FAILED
    assert words in row["reason"]


def test_a_damaged_recording_is_a_failed_row_with_the_reason(copy: Path) -> None:
    copy.write_bytes(copy.read_bytes()[:5000])
    row = identified_here(job(copy))
    assert (row["status"], row["name"], row["inertia_value"]) == (FAILED, "copied", None)
    assert "is damaged" in row["reason"]


def test_a_recording_that_does_not_quote_its_configuration_says_what_to_do(copy: Path) -> None:
    row = identified_here(job(with_info(copy, config_text=None)))
    assert row["status"] == FAILED
    assert "name it in a rig.yaml (backend: recorded)" in row["reason"]


def test_code_that_a_recording_names_is_not_run(copy: Path) -> None:
    own = copy.parent / "own.py"
    own.write_text("raise SystemExit\n", encoding="utf-8")
    text = f"backend: simulated\nsimulated: {{}}\nmodel: {{effects_from: {own}}}\n"
    row = identified_here(job(with_info(copy, config_text=text)))
    assert row["status"] == FAILED
    assert "code that a recording names is not run" in row["reason"]


def test_a_yaml_without_a_date_has_none_and_with_one_of_its_recordings_has_that(played: Path, tmp_path: Path) -> None:
    (tmp_path / "tuesday").mkdir()
    config = tmp_path / "tuesday" / "rig.yaml"
    config.write_text(recorded(played), encoding="utf-8")
    row = identified_here(job(config))
    assert (row["status"], row["name"], row["rig"]) == (IDENTIFIED, "tuesday", "rig")
    assert row["recorded_utc"] == read_recording_h5(played).info["started_utc"]
    config.write_text(recorded("gone.csv"), encoding="utf-8")
    gone = identified_here(job(config))
    assert (gone["status"], gone["recorded_utc"]) == (FAILED, None)
    assert "gone.csv" in gone["reason"]


def test_effects_of_ones_own_stay_in_a_process_of_their_own(played: Path, tmp_path: Path) -> None:
    from rig import effects  # noqa: PLC0415 (compiled kernels)

    (tmp_path / "own.py").write_text(OWN_EFFECT, encoding="utf-8")
    config = tmp_path / "rig.yaml"
    config.write_text(recorded(played, "own.py"), encoding="utf-8")
    before = effects.known()
    row = identify_campaign(job(config))
    assert row["status"] == IDENTIFIED, row["reason"]
    assert effects.known() == before


def test_a_campaign_that_ends_its_process_is_not_taken_for_a_result(played: Path, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("import os\nos._exit(3)\n", encoding="utf-8")
    config = tmp_path / "rig.yaml"
    config.write_text(recorded(played, "own.py"), encoding="utf-8")
    with pytest.raises(ProcessEnded, match="its process ended with 3"):
        identify_campaign(job(config))


def test_a_file_that_is_no_recording_of_ours_is_a_failed_row(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = [1.0]
    row = identified_here(job(tmp_path / "other.h5"))
    assert row["status"] == FAILED
    assert "is not a recording of this program" in row["reason"]
