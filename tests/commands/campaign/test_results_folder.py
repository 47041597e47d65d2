"""The results folder is named early, made late and never overwrites anything."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from commands.campaign.results_folder import ResultsFolder
from rig.errors import UsageError

NOON = datetime(2025, 3, 4, 12, 0, 5, tzinfo=UTC)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_without_out_it_is_named_by_utc_time_and_campaign() -> None:
    folder = ResultsFolder(None, "default", NOON)
    assert folder.path == Path("runs/20250304T120005Z-default")
    assert not folder.path.exists() and folder.existing_path() is None


def test_it_is_made_with_its_parents_when_asked_for() -> None:
    folder = ResultsFolder(Path("a/b/c"), "default", NOON)
    assert folder.create().is_dir()
    assert folder.existing_path() == Path("a/b/c")


@pytest.mark.parametrize("make", [Path.mkdir, Path.touch], ids=["folder", "file"])
def test_an_existing_out_is_refused_before_anything_happens(tmp_path: Path, make: object) -> None:
    make(tmp_path / "mine")  # type: ignore[operator]
    with pytest.raises(UsageError, match="exists and is never overwritten"):
        ResultsFolder(tmp_path / "mine", "default", NOON)


def test_two_campaigns_in_one_second_get_two_folders() -> None:
    ResultsFolder(None, "default", NOON).create()
    assert ResultsFolder(None, "default", NOON).create() == Path("runs/20250304T120005Z-default-2")


def test_a_folder_that_cannot_be_made_is_an_error_with_its_cure() -> None:
    Path("file").touch()
    with pytest.raises(UsageError, match=r"cannot make .* Choose another with --out"):
        ResultsFolder(Path("file/inside"), "default", NOON).create()


def test_a_folder_in_which_nothing_was_recorded_can_be_taken_back() -> None:
    folder = ResultsFolder(Path("out"), "default", NOON)
    folder.create()
    folder.discard()
    assert not Path("out").exists()
