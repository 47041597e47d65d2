"""Where the recording came from, as it says itself: files, clocks, versions; the configuration folded away."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identify.report.page.markup import Markup, Piece, element, folded, join, section
from rig.recording.run import Recording

LONG = 300  # characters of a value that gets a fold of its own
FOLDED = {"config": "Configuration as understood, with all defaults", "versions": "Versions"}


def origin(recording: Recording) -> Markup:
    """Origin of the data."""
    rows: dict[str, list[Markup]] = {"": [], **{head: [] for head in FOLDED}}
    long: list[Markup] = []
    for key, value in _flat(recording.info).items():
        head = key.partition(":")[0]
        if "\n" in value or len(value) > LONG:
            long.append(folded(key, element("pre", value, tabindex="0", role="region", aria_label=key)))
        else:
            rows[head if head in FOLDED and ":" in key else ""].append(_row(key, value))
    lengths = f"{len(recording.runs)} runs, {sum(len(run.time_s) for run in recording.runs)} samples"
    rows[""].insert(0, _row("recording", lengths))
    folds = [folded(words, _table(rows[head])) for head, words in FOLDED.items() if rows[head]]
    return section("origin", "Origin of the data", _table(rows[""]), *folds, *long)


def _row(key: str, value: Piece) -> Markup:
    return element("tr", element("th", key, scope="row"), element("td", value))


def _table(rows: list[Markup]) -> Markup:
    return element("table", element("tbody", join(rows)), class_="plain")


def _flat(info: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    out: dict[str, str] = {}
    for key, value in info.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, Mapping):
            out |= _flat(value, f"{name}: ")
        elif isinstance(value, list | tuple):
            out[name] = ", ".join(str(item) for item in value)
        elif value is not None:
            out[name] = str(value)
    return {name: text for name, text in out.items() if text}
