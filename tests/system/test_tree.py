"""The tree of the identifier stays one that a reader can survey: few files a folder, short files."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
IDENTIFY = ROOT / "identify"
MODULES = [path for path in IDENTIFY.rglob("*.py") if "__pycache__" not in path.parts]
MAX_TOP_LEVEL, MAX_IN_A_FOLDER, MAX_LINES = 6, 15, 300


def test_the_top_level_has_few_modules() -> None:
    assert len(list(IDENTIFY.glob("*.py"))) <= MAX_TOP_LEVEL


def test_no_folder_has_many_modules() -> None:
    folders = Counter(path.parent.relative_to(ROOT).as_posix() for path in MODULES)
    assert {folder: n for folder, n in folders.items() if n > MAX_IN_A_FOLDER} == {}


def test_no_module_is_long() -> None:
    lines = {path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {name: n for name, n in lines.items() if n > MAX_LINES} == {}
