"""Two sets of results, key by key: what differs but for times, versions, paths and keys renamed on purpose."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

RENAMED: Mapping[str, str] = {}  # key before -> key after, of result.json; add to it what a change renames on purpose
IGNORED = re.compile(r"schema_version|version|(.*_)?(seconds|elapsed_s|created|path|file)")
PATH = re.compile(r"(?:/[\w.+-]+)+/")  # folders before a file's name, in a sentence
MISSING = "(missing)"


def leaves(value: Any, renamed: Mapping[str, str], at: str = "") -> Iterator[tuple[str, Any]]:
    """Every number, text and empty container of a result with its dotted place."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            if not IGNORED.fullmatch(key):
                yield from leaves(inner, renamed, f"{at}.{renamed.get(key, key)}".lstrip("."))
    elif isinstance(value, list) and value:
        for i, inner in enumerate(value):
            yield from leaves(inner, renamed, f"{at}[{i}]")
    else:
        yield at, PATH.sub("", value) if isinstance(value, str) else value


def differences(before: Any, after: Any, renamed: Mapping[str, str] = RENAMED) -> list[str]:
    """One line for every place at which two results differ; numbers have to be the same to the last bit."""
    old, new = dict(leaves(before, renamed)), dict(leaves(after, {}))
    return [
        f"{place}: {old.get(place, MISSING)!r} -> {new.get(place, MISSING)!r}"
        for place in dict.fromkeys((*old, *new))
        if not _same(old.get(place, MISSING), new.get(place, MISSING))
    ]


def _same(one: Any, other: Any) -> bool:
    return type(one) is type(other) and one == other


def compare(before: Path, after: Path, renamed: Mapping[str, str] = RENAMED) -> tuple[int, list[str]]:
    """Number of results that both folders hold, and one line for every difference, that of a missing result too."""
    names = sorted({p.name for folder in (before, after) for p in folder.glob("*.json")})
    both, lines = 0, []
    for name in names:
        paths = (before / name, after / name)
        if absent := [str(p.parent) for p in paths if not p.exists()]:
            lines.append(f"{Path(name).stem}: no result in {' and '.join(absent)}")
            continue
        both += 1
        one, other = (json.loads(p.read_text(encoding="utf-8")) for p in paths)
        lines += [f"{Path(name).stem}: {line}" for line in differences(one, other, renamed)]
    return both, lines
