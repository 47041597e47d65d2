"""Where the recording came from, as it says itself: files, clocks, versions; the configuration folded away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import yaml

from identify.report.page.markup import Markup, Piece, element, folded, join, section, table
from identify.wording import number
from rig.recording.run import Recording
from rig.rounding import rounded_down

MAX_UNFOLDED_CHARACTERS = 300  # characters of a value that gets a fold of its own
DIGITS = 6  # significant digits of a measured number; a configuration is shown as it was written
YAML_WIDTH = 110  # characters
HEADINGS = {
    "started_utc": "started (UTC)",
    "ended_utc": "ended (UTC)",
    "config_file": "configuration file",
    "config_overrides": "overridden with --set",
    "system": "operating system",
    "backend": "devices",
    "played_on": "played on",
}
PLAYED_ON = {"simulated": "simulated rig", "bench": "bench", "emulated": "emulated devices"}
LATENESS = {"p50": "median", "p99": "99 %", "p99.9": "99.9 %", "p100": "largest"}
OWN_PLACE = ("config", "config_text", "config_included", "versions", "sets")


def origin(recording: Recording) -> Markup:
    """Origin of the data."""
    info = recording.info
    played = {"played_on": PLAYED_ON.get(info["played_on"], info["played_on"])} if "played_on" in info else {}
    short, long = _values({k: v for k, v in {**info, **played}.items() if k not in OWN_PLACE})
    runs = f"{len(recording.runs)} run{'' if len(recording.runs) == 1 else 's'}"
    lengths = f"{runs}, {sum(len(run.time_s) for run in recording.runs)} samples"
    return section(
        "origin",
        "Origin of the data",
        _rows({"recording": lengths, **short}),
        _sets(info.get("sets") or ()),
        *_configuration(info),
        *[folded("Versions", _rows({k: str(v) for k, v in several.items()})) for several in _mapping(info, "versions")],
        *[_text(name, words) for name, words in long.items()],
    )


def _values(info: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, str]]:
    """What fits into a row of the table, and what gets a fold of its own."""
    short: dict[str, str] = {}
    long: dict[str, str] = {}
    for key, words in _flat(info).items():
        name = HEADINGS.get(key, key)
        (long if "\n" in words or len(words) > MAX_UNFOLDED_CHARACTERS else short)[name] = words
    return short, long


def _flat(info: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Every value in words under its dotted name; lists of anything but plain values as YAML."""
    out: dict[str, str] = {}
    for key, value in info.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            out |= _flat(value, f"{name}.")
        elif isinstance(value, list | tuple) and any(isinstance(item, Mapping | list | tuple) for item in value):
            out[name] = _yaml(value)
        elif isinstance(value, list | tuple):
            out[name] = "; ".join(_words(item) for item in value)
        elif value is not None:
            out[name] = _words(value)
    return {name: words for name, words in out.items() if words}


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}" if value == round(value, 3) else number(value, DIGITS)
    try:
        moment = datetime.fromisoformat(value) if isinstance(value, str) and "T" in value else None
    except ValueError:
        moment = None
    return str(value) if moment is None else f"{moment:%Y-%m-%d %H:%M:%S}"


def _configuration(info: Mapping[str, Any]) -> list[Markup]:
    """The files as they were written, and what was made of them."""
    out = []
    if isinstance(written := info.get("config_text"), str) and written:
        out.append(_text(f"{info.get('config_file') or 'Configuration'} as written", written))
    for included in _mapping(info, "config_included"):
        out += [_text(f"{name} as included", str(words)) for name, words in included.items()]
    for understood in _mapping(info, "config"):
        out.append(_text("Configuration as understood, with all defaults", _yaml(understood)))
    return out


def _sets(sets: Sequence[Mapping[str, Any]]) -> Markup:
    """What the loop did in each set: how late its ticks were, and what was lost."""
    late = [key for key in (sets[0] if sets else ()) if key.startswith("late_ms_")]
    if not late:
        return Markup("")
    rows: list[list[Piece]] = [
        [
            str(one.get("name", "")),
            "yes" if one.get("complete") else "NO",
            str(one.get("missed_ticks", "-")),
            str(one.get("invalid_samples", "-")),
            "-" if (peak_nm := one.get("peak_torque_nm")) is None else rounded_down(peak_nm),
            *[number(one.get(key), 3) for key in late],
        ]
        for one in sets
    ]
    head: list[Piece] = ["set", "complete", "missed ticks", "samples lost", "peak torque (N·m)"]
    head += [f"late (ms), {LATENESS.get(key.removeprefix('late_ms_'), key)}" for key in late]
    return table(head, rows, "Time base: how late the ticks of the control loop were, set by set.")


def _mapping(info: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """The mapping under ``key``, none where there is none."""
    value = info.get(key)
    return [value] if isinstance(value, Mapping) and value else []


def _text(name: str, words: str) -> Markup:
    return folded(name, element("pre", words, tabindex="0", role="region", aria_label=name))


def _rows(rows: Mapping[str, str]) -> Markup:
    cells = [element("tr", element("th", k, scope="row"), element("td", words)) for k, words in rows.items()]
    return element("table", element("tbody", join(cells)), class_="plain")


def _yaml(value: Any) -> str:
    dumped: str = yaml.safe_dump(
        _plain(value), sort_keys=False, allow_unicode=True, default_flow_style=None, width=YAML_WIDTH
    )
    return dumped


def _plain(value: Any) -> Any:
    """Without what YAML has no word for."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):
        return _plain(value.item())
    return value if isinstance(value, bool | int | float | str | None) else str(value)
