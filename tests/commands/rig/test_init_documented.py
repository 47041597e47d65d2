"""The lines with `rig init` in the pages work where they are typed: in a folder that has a rig.yaml already."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from scipy.io import savemat

from commands.rig.app import app
from rig.config.load import load_config
from rig.recording.load import read_recording
from tests.commands.rig.exported_text import RATE, TIME, TORQUE, rows
from tests.commands.support import command

ROOT = Path(__file__).parents[3]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
BESIDE = "backend: simulated\nsimulated: {}\n"


def documented() -> list[tuple[str, str, str]]:
    """Page, command line and, in a block of lines, the one that follows; of those that name a recording or --out."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        lines = [
            *re.findall(r"^(.*\brig init .*)\n(.*)", text, re.M),
            *((m, "") for m in re.findall(r"`([^`\n]+)`", text)),
        ]
        for line, following in lines:
            if match := re.fullmatch(r"(?:\S*/)?(rig init \S+[.]\w.*)", line.strip()):
                found.append((page.name, match[1], "" if following.startswith("```") else following))
    return found


def test_the_pages_have_such_lines() -> None:
    assert {page for page, _, _ in documented()} >= {"README.md", "bring-your-data.md", "recipes.md"}


@pytest.mark.parametrize(("page", "line", "following"), documented())
def test_a_documented_line_works_beside_a_rig_yaml(
    page: str, line: str, following: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.yaml").write_text(BESIDE, encoding="utf-8")
    words = shlex.split(line)[2:]
    out = words[words.index("--out") + 1]
    for word in words:
        if word.endswith((".csv", ".mat")):
            _record(tmp_path / word.replace("*", "1"))
    done = command(app, "init", *words)
    assert done.exit_code == 0, done.stderr
    assert read_recording(load_config(tmp_path / out)).runs
    assert (tmp_path / "rig.yaml").read_text(encoding="utf-8") == BESIDE
    if following:
        assert shlex.split(following)[-1] == out, f"{page}: the line below identifies something else"


def _record(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    if path.suffix == ".mat":
        savemat(path, {"time_s": TIME, "torque_nm": TORQUE, "rate_rad_s": RATE})
    else:
        path.write_text("time_s,torque_nm,rate_rad_s\n" + rows(TIME, TORQUE, RATE), encoding="utf-8")
