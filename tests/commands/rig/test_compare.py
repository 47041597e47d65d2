"""`rig compare`: tables on stdout, a page where asked for, exit code 2 with a plain sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from commands.rig.app import app
from identify.report.files import result_json
from tests.commands.support import command
from tests.identify.sample import sample


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    content = result_json(sample(1.0)[0])
    for name in ("before", "later"):
        (tmp_path / name).mkdir()
        content["after"]["parameters"]["damping"]["ci95"] = [0.1, 0.2] if name == "later" else [0.04, 0.05]
        (tmp_path / name / "result.json").write_text(json.dumps(content), encoding="utf-8")
    return tmp_path / "before", tmp_path / "later"


def test_it_prints_what_changed(folders: tuple[Path, Path]) -> None:
    done = command(app, "compare", *folders)
    assert done.exit_code == 0, done.output
    assert "Changed by more than both intervals: damping C" in done.stdout
    assert "Coulomb friction, level" in done.stdout
    assert done.stderr == ""


def test_the_page_is_written_beside_the_text_and_never_over_a_file(folders: tuple[Path, Path], tmp_path: Path) -> None:
    page = tmp_path / "both.html"
    done = command(app, "compare", *folders, "--out", page)
    assert done.exit_code == 0, done.output
    assert "damping C" in page.read_text(encoding="utf-8")
    again = command(app, "compare", *folders, "--out", page)
    assert again.exit_code == 2
    assert "exists and is never overwritten" in again.stderr and again.stdout == ""


def test_a_page_that_cannot_be_written_is_said(folders: tuple[Path, Path], tmp_path: Path) -> None:
    done = command(app, "compare", *folders, "--out", tmp_path / "gone" / "both.html")
    assert done.exit_code == 2
    assert "cannot write --out" in done.stderr


def test_a_folder_without_a_result_is_said(folders: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "aborted").mkdir()
    done = command(app, "compare", folders[0], tmp_path / "aborted")
    assert done.exit_code == 2
    assert "has no result.json" in done.stderr and "rig recover" in done.stderr
