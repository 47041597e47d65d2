"""Which campaigns a pattern matches, and what makes one a changed one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from commands.identify_batch.campaigns import campaigns_of, content_of, inputs_of, keeps_apart
from rig.errors import UsageError
from tests.commands.identify_batch.campaigns import recorded as recorded_from


def write(path: Path, text: str = "x") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_a_folder_stands_for_the_recording_in_it_and_each_campaign_comes_once(tmp_path: Path) -> None:
    first, second = write(tmp_path / "b" / "recording.h5"), write(tmp_path / "a" / "recording.h5")
    (tmp_path / "empty").mkdir()
    found, others = campaigns_of(f"{tmp_path}/**")
    assert found == [second.as_posix(), first.as_posix()]
    assert str(tmp_path / "empty") in others


def test_a_yaml_counts_if_it_is_recorded_or_cannot_be_read(tmp_path: Path) -> None:
    recorded = write(tmp_path / "recorded.yaml", recorded_from("run.csv"))
    damaged = write(tmp_path / "damaged.yaml", "backend: [")
    write(tmp_path / "model.yaml", "inertia_kg_m2: 0.02\n")
    write(tmp_path / "played.yaml", "backend: simulated\nsimulated: {}\n")
    found, others = campaigns_of(f"{tmp_path}/*.yaml")
    assert found == [damaged.as_posix(), recorded.as_posix()]
    assert [Path(path).name for path in others] == ["model.yaml", "played.yaml"]


def test_a_pattern_without_a_match_is_refused_with_what_to_give(tmp_path: Path) -> None:
    write(tmp_path / "notes.txt")
    with pytest.raises(UsageError, match=r"matches no recorded campaign \(1 other .*'runs/\*/recording\.h5'"):
        campaigns_of(f"{tmp_path}/*")


def test_all_files_that_a_yaml_names_belong_to_it(tmp_path: Path) -> None:
    model = write(tmp_path / "models" / "model.yaml", "model: {effects_from: own.py}\n")
    config = write(tmp_path / "rig.yaml", "model: models/model.yaml\n" + recorded_from("data/run.csv"))
    expected = {config, model, tmp_path / "models" / "own.py", tmp_path / "data" / "run.csv"}
    assert set(inputs_of(config, ())) == expected


def test_any_change_of_what_decides_a_row_shows_in_its_content(tmp_path: Path) -> None:
    data = write(tmp_path / "run.csv", "1,2\n")
    config = write(tmp_path / "rig.yaml", recorded_from("run.csv"))
    contents = [content_of(config, (), "1"), content_of(config, (), "2"), content_of(config, ("identify.seed=2",), "1")]
    data.write_text("1,3\n", encoding="utf-8")
    contents.append(content_of(config, (), "1"))
    data.unlink()
    contents.append(content_of(config, (), "1"))
    config.write_text(recorded_from("run.csv") + "\n", encoding="utf-8")
    contents.append(content_of(config, (), "1"))
    assert len(set(contents)) == 6


def test_the_time_of_a_file_does_not_matter(tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.h5")
    before = content_of(recording, (), "1")
    os.utime(recording, (1.0, 1.0))
    assert content_of(recording, (), "1") == before


@pytest.mark.parametrize("text", ["model: {effects_from: own.py}", "identify.channels.temp.kind=torque"])
def test_effects_of_ones_own_and_channels_are_kept_apart(text: str) -> None:
    assert keeps_apart(["backend: recorded", text])
    assert not keeps_apart(["backend: recorded"])
