"""`rig report`: one line on stdout, or a plain sentence and exit code 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from commands.rig.app import app
from identify.report.files import write_results
from tests.commands.support import command
from tests.identify.sample import TRUTH, sample


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "results"
    path.mkdir()
    write_results(path, *sample(2.0), TRUTH, "default")
    return path


def test_the_report_is_made_again_and_its_path_printed(folder: Path) -> None:
    original = (folder / "report.html").read_bytes()
    (folder / "report.html").write_text("lost")
    done = command(app, "report", folder)
    assert done.exit_code == 0, done.output
    assert done.stdout == f"Report: {folder / 'report.html'}\n"
    assert (folder / "report.html").read_bytes() == original


@pytest.mark.parametrize(("name", "message"), [("gone", "there is no such folder"), ("a.txt", "is not a folder")])
def test_what_is_no_results_folder_is_said(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "a.txt").write_text("x")
    done = command(app, "report", tmp_path / name)
    assert done.exit_code == 2
    assert message in done.stderr and "give the results folder" in done.stderr


def test_an_empty_folder_is_said_and_nothing_is_written(tmp_path: Path) -> None:
    done = command(app, "report", tmp_path)
    assert done.exit_code == 2
    assert "has no result.json" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_damaged_numbers_are_said_without_a_traceback(folder: Path) -> None:
    (folder / "result.json").write_text('{"accepted": tru')
    done = command(app, "report", folder)
    assert done.exit_code == 2
    assert "result.json: is damaged" in done.stderr and "line 1 column 14" in done.stderr
    assert "Traceback" not in done.output
