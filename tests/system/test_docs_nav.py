"""The navigation of the site has every page, whatever the installed mkdocs makes of one that is missing."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SUFFIXES = (".md", ".ipynb")


def site() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    return loaded


def pages_in(nav: Any) -> list[str]:
    """The files of a navigation, in its order; links to elsewhere are none."""
    if isinstance(nav, str):
        return [nav] if nav.endswith(SUFFIXES) else []
    return [page for one in (nav.values() if isinstance(nav, dict) else nav) for page in pages_in(one)]


def is_left_out(page: str) -> bool:
    """Whether the site leaves a page out of its navigation on purpose: pages that a table of another page lists."""
    folder, _, name = f"/{page}".rpartition("/")
    patterns = (line.rpartition("/") for line in site()["not_in_nav"].split())
    return any(folder == of and fnmatchcase(name, pattern) for of, _, pattern in patterns)


def test_every_page_is_in_the_navigation_once_or_left_out_on_purpose() -> None:
    listed = pages_in(site()["nav"])
    pages = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*") if path.suffix in SUFFIXES)
    assert [page for page in pages if page not in listed and not is_left_out(page)] == [], "add it to nav in mkdocs.yml"
    assert sorted(set(listed)) == sorted(listed)
    assert [page for page in listed if page not in pages] == []


def test_the_continuous_integration_sees_the_warnings_of_the_build() -> None:
    """`--quiet` drops warnings before `--strict` counts them: a page had been missing."""
    build = next(line for line in (ROOT / ".ci" / "run").read_text("utf-8").splitlines() if "mkdocs build" in line)
    assert "--strict" in build and "--quiet" not in build and " -q" not in build
