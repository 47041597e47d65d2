"""The places (file, line) of the limits that a campaign would break, and where its sets come from."""

from __future__ import annotations

import contextlib
from typing import Any

from commands.campaign.backends import RECORDED
from commands.terminal.display import plain
from rig.config.load import LoadedConfig
from rig.config.parsing.messages import place_of
from rig.config.parsing.overrides import apply_override
from rig.config.parsing.yaml_text import parse
from rig.errors import ConfigError, PreflightRefusal


def with_locations(error: PreflightRefusal, loaded: LoadedConfig) -> PreflightRefusal:
    """The same refusal, saying file, line, key and value of every limit that it speaks of."""
    document = parse(loaded.text, str(loaded.path))
    for override in loaded.overrides:
        with contextlib.suppress(ConfigError):  # it reaches into a file that an earlier one names: no place of its own
            apply_override(document, override)
    lines = []
    for key in error.keys:
        path = tuple(key.split("."))
        value: Any = loaded.config
        for name in path:
            value = getattr(value, name, None)
        if value is None:
            continue
        written = path in document.places
        where = str(place_of(document, path)) if written else f"{loaded.path} (not in the file: the default)"
        shown = f"{value:g}" if isinstance(value, float) else plain(str(value))
        lines.append(f"  {plain(where)}: {key} is {shown}")
    if loaded.config.backend == RECORDED and ("excitation",) not in document.places:
        lines.append(
            f"  {plain(str(loaded.path))} reads recordings (backend: recorded) and has no excitation, so these are the "
            "sets of the default campaign. Without --dry-run and --emulate its recordings are identified; to rehearse "
            "a campaign on this platform, give it an excitation"
        )
    placed = PreflightRefusal("\n".join([str(error), *lines]))
    placed.keys = error.keys
    return placed
