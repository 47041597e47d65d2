"""Whether the disk takes a campaign is said before anything moves."""

from __future__ import annotations

import errno
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import pytest

from commands.campaign.disk_space import START_BYTES, disk_space_warning
from commands.campaign.results_folder import ResultsFolder
from commands.rig.app import app
from rig.errors import Aborted
from tests.commands.support import command, put_on_stage, write_config
from tests.rig.scripted import ScriptedRig


class Usage(NamedTuple):
    free: int


def leave(monkeypatch: pytest.MonkeyPatch, free: int) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(free))


def test_a_disk_that_is_full_already_is_refused_before_the_rig_is_touched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = ScriptedRig()
    put_on_stage(monkeypatch, rig)
    leave(monkeypatch, 8192)
    done = command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 130
    assert "No space left on device: 0.00819 MB are free" in done.stderr and "about 8 MB" in done.stderr
    assert rig.log == [] and not (tmp_path / "out").exists()


def test_a_disk_that_will_be_full_before_the_end_is_told_even_if_quiet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    leave(monkeypatch, 2_000_000)
    done = command(app, "play", write_config(tmp_path), "--quiet", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "2 MB are free" in done.stderr and "writes about 8 MB" in done.stderr


def test_the_room_is_that_of_the_folder_in_which_the_results_will_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []
    monkeypatch.setattr(shutil, "disk_usage", lambda path: asked.append(path) or Usage(START_BYTES))
    assert str(tmp_path) in disk_space_warning(tmp_path / "not" / "yet", 1e7)
    assert asked == [tmp_path]


def test_a_file_system_that_does_not_tell_is_no_hindrance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(path: Path) -> Usage:
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(shutil, "disk_usage", silent)
    assert disk_space_warning(tmp_path, 1e12) == ""


def test_a_folder_that_a_full_disk_does_not_take_ends_as_a_full_disk_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, *arguments: object, **more: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    folder = ResultsFolder(tmp_path / "out", "name", datetime.now(UTC))
    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(Aborted, match="No space left on device"):
        folder.create()
